"""OpenEXR files in and out, as Cycles and other renderers name their passes.

Pictures are float32 (height, width, channels), row 0 on top, scene-linear, of the size
of the file's display window.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import exr_library
from .arrays import Array
from .atomic import replacing
from .errors import PictureError
from .exr_library import Part

_COMPONENTS = ("RGB", "XYZ", "rgb", "xyz")
_COMPOSITED = "Composite."  # Blender's layer for the output of its compositor


@dataclass(frozen=True)
class Names:
    """What the passes are called; a layer before them may be left out."""

    beauty: str = "Combined"
    noisy: str = "Noisy Image"
    albedo: str = "Denoising Albedo"
    normal: str = "Denoising Normal"


CYCLES = Names()


@dataclass(frozen=True)
class Beauty:
    """A rendered picture."""

    radiance: Array
    """(h, w, 3), premultiplied."""
    alpha: Array | None
    """(h, w)"""
    noisy: Array | None
    """(h, w, 3), before denoising."""

    @property
    def picture(self) -> Array:
        """Radiance and, where there is one, alpha: (h, w, 3) or (h, w, 4)."""
        if self.alpha is None:
            return self.radiance
        return np.dstack((self.radiance, self.alpha))


@dataclass(frozen=True)
class Guides:
    """Full-resolution passes, (H, W, 3); alpha (H, W)."""

    albedo: Array
    normal: Array
    radiance: Array | None
    alpha: Array | None


def read_beauty(path: str | Path, names: Names = CYCLES) -> Beauty:
    """Read the picture: the pass `names.beauty`, or plain R, G, B.

    With it, where there is one, the noisy pass. Raises PictureError if the file cannot
    be read or has no such pass.
    """
    file = _File(path)
    radiance = file.colour(names.beauty, plain=True)
    noisy = file.colour(names.noisy) if file.has(names.noisy) else None
    return Beauty(radiance, file.alpha(names.beauty), noisy)


def read_guides(
    path: str | Path, *, full: bool = False, names: Names = CYCLES
) -> Guides:
    """Read albedo and normal and, where there is one, alpha; for `full`, radiance.

    The radiance is that of the noisy pass or, in a file of an undenoised render, that
    of the picture. Raises PictureError if the file cannot be read or lacks a pass.
    """
    file = _File(path)
    radiance = None
    if full:
        noisy = names.noisy if file.has(names.noisy) else names.beauty
        radiance = file.colour(noisy, plain=True)
    albedo, normal = file.colour(names.albedo), file.colour(names.normal)
    return Guides(albedo, normal, radiance, file.alpha(names.beauty))


def write_picture(path: str | Path, channels: Mapping[str, Array]) -> None:
    """Write (H, W) planes by channel name, as float32, all at once or not at all.

    Raises PictureError, and leaves `path` as it was, if it cannot be written.
    """
    path = Path(path)
    planes = {k: np.ascontiguousarray(v, np.float32) for k, v in channels.items()}
    try:
        with replacing(path) as unfinished:
            exr_library.write(unfinished, planes)
    except (OSError, PictureError) as error:
        raise PictureError(f"cannot write {path}: {error}") from error


class _File:
    """The channels of a file by full name, as `ViewLayer.Combined.R`."""

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.channels = {name: (part, pixels) for name, part, pixels in _read(path)}

    def has(self, wanted: str) -> bool:
        return self._prefix(wanted) is not None

    def colour(self, wanted: str, *, plain: bool = False) -> Array:
        """Return (H, W, 3) of a pass; `plain`: or of R, G, B without a pass."""
        prefix = self._prefix(wanted)
        if prefix is None and plain and self._components(""):
            prefix = ""
        if prefix is None:
            raise PictureError(
                f"{self.path} has no pass {wanted!r}; it holds {self._contents()}"
            )
        planes = [self.plane(name) for name in self._components(prefix)]
        return np.stack(planes, axis=-1)

    def alpha(self, wanted: str) -> Array | None:
        """Return alpha (H, W) of a pass, or the plain one, or None."""
        prefix = self._prefix(wanted)
        name = "A" if prefix is None else f"{prefix}.A"
        return self.plane(name) if name in self.channels else None

    def _prefix(self, wanted: str) -> str | None:
        """Return the full name of the one pass that is called so, or None."""
        prefixes = {name.rpartition(".")[0] for name in self.channels}
        matches = [
            prefix
            for prefix in sorted(prefixes)
            if f".{prefix}".endswith(f".{wanted}") and self._components(prefix)
        ]
        if wanted in matches:
            return wanted
        matches = [x for x in matches if not x.startswith(_COMPOSITED)] or matches
        if len(matches) > 1:
            raise PictureError(
                f"{self.path} holds {wanted!r} in several layers: "
                f"{', '.join(matches)}; give one of these names"
            )
        return matches[0] if matches else None

    def _components(self, prefix: str) -> list[str]:
        dotted = f"{prefix}." if prefix else ""
        for letters in _COMPONENTS:
            names = [dotted + letter for letter in letters]
            if all(name in self.channels for name in names):
                return names
        return []

    def _contents(self) -> str:
        passes = {name.rpartition(".")[0] or name for name in self.channels}
        return ", ".join(sorted(passes)) or "nothing"

    def plane(self, name: str) -> Array:
        part, pixels = self.channels[name]
        (left, top), (right, bottom) = part.data_window
        size = (bottom - top + 1, right - left + 1)
        if pixels.dtype.kind not in "fu" or pixels.shape != size:
            raise PictureError(
                f"channel {name!r} of {self.path} is deep or subsampled; "
                "save it with flat channels of full resolution"
            )
        return _placed(pixels, part)


def _read(path: str | Path) -> Iterator[tuple[str, Part, Any]]:
    """Yield (full channel name, its part, pixels) of all parts of a file."""
    if not Path(path).is_file():
        raise PictureError(f"no file {path}")
    parts = exr_library.read(path)
    for part in parts:
        layer = part.name if len(parts) > 1 else ""
        for name, pixels in part.channels.items():
            # Blender repeats the part's name in its channels, others do not
            full = f"{layer}.{name}" if layer and "." not in name else name
            yield full, part, pixels


def _placed(pixels: Any, part: Part) -> Array:
    """Return `pixels` of the data window in the display window, zero around."""
    (left, top), (right, bottom) = part.display_window
    x, y = part.data_window[0]
    size = (bottom - top + 1, right - left + 1)
    if (x, y) == (left, top) and pixels.shape == size:
        return np.asarray(pixels, np.float32)
    picture = np.zeros(size, np.float32)
    rows, source_rows = _shared(y - top, pixels.shape[0], size[0])
    columns, source_columns = _shared(x - left, pixels.shape[1], size[1])
    picture[rows, columns] = pixels[source_rows, source_columns]
    return picture


def _shared(offset: int, length: int, limit: int) -> tuple[slice, slice]:
    """Return where `length` pixels at `offset` go, and which of them."""
    start, stop = max(offset, 0), min(offset + length, limit)
    stop = max(start, stop)
    return slice(start, stop), slice(start - offset, stop - offset)
