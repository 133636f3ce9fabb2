"""What weights files say they are for, read from their headers alone.

Neither torch nor safetensors is needed, so a panel can use it. A safetensors file
begins with the length of its header (8 bytes, little-endian) and the header, JSON.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

DIRECTORY = Path(__file__).with_name("weights")
GUIDES = "fast"
"""What a configuration calls albedo and normal: the only guides there are."""
_LARGEST_HEADER = 1 << 20  # far above any real one; bounds hostile files


@dataclass(frozen=True)
class WeightsHeader:
    """A network's preset, enlargement and the Blender series of its training.

    `blender_series` as 4.5; empty where the file does not say.
    """

    preset: str
    scale: int
    blender_series: str = ""


def headers(folder: Path | None = None) -> list[WeightsHeader]:
    """Those of the networks in a folder, the shipped ones by default.

    A file that is no network's is left out: loading it will say why.
    """
    paths = sorted((folder or DIRECTORY).glob("*_x*.safetensors"))
    found = (read_header(path) for path in paths)
    return [header for header in found if header is not None]


def read_header(path: Path) -> WeightsHeader | None:
    """That of one file; None where it holds no network."""
    try:
        return _read(path, path.stat().st_mtime_ns)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


@lru_cache(maxsize=64)
def _read(path: Path, _changed: int) -> WeightsHeader:
    with path.open("rb") as file:
        length = int.from_bytes(file.read(8), "little")
        if length > _LARGEST_HEADER:
            raise ValueError(f"a header of {length} bytes")
        metadata = json.loads(file.read(length))["__metadata__"]
    config = json.loads(metadata["config"])
    if config.get("guides", GUIDES) != GUIDES:
        raise ValueError("guides that are not rendered")
    return WeightsHeader(
        preset=path.name.partition("_")[0],
        scale=int(config["scale"]),
        blender_series=str(metadata.get("blender_series", "")),
    )
