"""Which weights files there are and what they are for, by their headers alone.

Neither torch nor safetensors is needed, so a panel and `xrds info` can use it. A
safetensors file begins with the length of its header (8 bytes, little-endian) and the
header, JSON.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import WeightsError

PRESETS = ("fast", "balanced", "paper")
"""The names of networks, the quickest first."""
DIRECTORY = Path(__file__).with_name("weights")
GUIDES = "fast"
"""What a configuration calls albedo and normal: the only guides there are."""
_LARGEST_HEADER = 1 << 20  # far above any real one; bounds hostile files


@dataclass(frozen=True)
class WeightsHeader:
    """What the header of a weights file says.

    Attributes
    ----------
    preset : str
        Name of the preset.
    scale : int
        Output pixels per low-resolution pixel along one axis.
    blender_series : str
        Blender's series of the training, such as 4.5; empty where the file does not
        say.
    """

    preset: str
    scale: int
    blender_series: str = ""


def available(directory: str | Path | None = None) -> list[dict[str, Any]]:
    """List the weights files of a folder.

    Parameters
    ----------
    directory : str or Path, optional
        The folder; the shipped files by default.

    Returns
    -------
    records : list of dict
        With the keys preset, scale, file, sha256 and blender_series.

    Raises
    ------
    WeightsError
        If a file named as a preset's is damaged.
    """
    return [_make_record(path) for path in network_files(Path(directory or DIRECTORY))]


def network_files(folder: Path) -> list[Path]:
    """The files in a folder that are named as a preset's."""
    paths = sorted(folder.glob("*_x*.safetensors"))
    return [path for path in paths if path.name.split("_x")[0] in PRESETS]


def _make_record(path: Path) -> dict[str, Any]:
    header = read_header(path)
    if header is None:
        raise WeightsError(f"{path} is not a complete weights file; download it again")
    return {
        "preset": header.preset,
        "scale": header.scale,
        "file": path.name,
        "sha256": _hash_file(path),
        "blender_series": header.blender_series or None,
    }


def _hash_file(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def headers(folder: Path | None = None) -> list[WeightsHeader]:
    """Those of the networks in a folder, the shipped ones by default.

    A file that is no network's is left out: loading it will say why.
    """
    paths = sorted((folder or DIRECTORY).glob("*_x*.safetensors"))
    headers_or_none = (read_header(path) for path in paths)
    return [header for header in headers_or_none if header is not None]


def read_header(path: Path) -> WeightsHeader | None:
    """That of one file; None where it holds no network, or is cut short."""
    try:
        status = path.stat()
        return _read(path, status.st_size, status.st_mtime_ns)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


@lru_cache(maxsize=64)
def _read(path: Path, size: int, _changed: int) -> WeightsHeader:
    with path.open("rb") as file:
        length = int.from_bytes(file.read(8), "little")
        if length > _LARGEST_HEADER:
            raise ValueError(f"a header of {length} bytes")
        header = json.loads(file.read(length))
    metadata = header.pop("__metadata__")
    end = max((tensor["data_offsets"][1] for tensor in header.values()), default=0)
    if size != 8 + length + end:
        raise ValueError(f"{size} bytes, but its header tells of {8 + length + end}")
    config = json.loads(metadata["config"])
    if config.get("guides", GUIDES) != GUIDES:
        raise ValueError("guides that are not rendered")
    return WeightsHeader(
        preset=path.name.partition("_")[0],
        scale=int(config["scale"]),
        blender_series=str(metadata.get("blender_series", "")),
    )
