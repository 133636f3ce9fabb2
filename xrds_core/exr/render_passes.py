"""OpenEXR files in and out, as Cycles and other renderers name their passes.

Pictures are float32 (height, width, channels), row 0 on top, scene-linear, of the size
of the file's display window.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import PictureError
from ..files import replacing
from . import openexr_io
from .channels import Channels, by_view, with_view
from .openexr_io import FLOAT_ZIP, Attributes, Encoding, Part, Window


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
    alpha: Array | None


def read_beauty(path: str | Path, names: Names = CYCLES) -> Beauty:
    """Read the picture of a file, and its noisy picture where it has one.

    Parameters
    ----------
    path : str or Path
        The file.
    names : Names
        What the passes are called.

    Returns
    -------
    beauty : Beauty
        The pass `names.beauty`, or plain R, G, B.

    Raises
    ------
    PictureError
        If the file cannot be read or has no such pass.
    """
    file = File(path)
    radiance = file.colour(names.beauty, plain=True)
    noisy = file.colour(names.noisy) if file.has(names.noisy) else None
    return Beauty(radiance, file.alpha(names.beauty), noisy)


def read_guides(path: str | Path, names: Names = CYCLES) -> Guides:
    """Read albedo, normal and, where there is one, alpha.

    Parameters
    ----------
    path : str or Path
        The file.
    names : Names
        What the passes are called.

    Returns
    -------
    guides : Guides

    Raises
    ------
    PictureError
        If the file cannot be read or lacks a pass.
    """
    file = File(path)
    albedo, normal = file.colour(names.albedo), file.colour(names.normal)
    return Guides(albedo, normal, file.alpha(names.beauty))


def write_picture(
    path: str | Path,
    channels: Mapping[str, Array],
    encoding: Encoding = FLOAT_ZIP,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write a picture, all at once or not at all.

    Parameters
    ----------
    path : str or Path
        The file, which stays as it was on an error.
    channels : mapping of str to (H, W) float32 array
        Planes by channel name.
    encoding : Encoding
        How numbers are stored.
    metadata : mapping of str to str, optional
        Attributes of the header.

    Raises
    ------
    PictureError
        If the file cannot be written.
    """
    planes = {name: encoding.plane(pixels) for name, pixels in channels.items()}
    with _write_whole(path) as unfinished:
        attributes = dict(metadata or {})
        openexr_io.write(unfinished, planes, encoding.codec, attributes)


def copy_picture(
    source: str | Path,
    path: str | Path,
    channels: Mapping[int, Mapping[str, Array]],
    *,
    alone: bool = False,
    window: Window | None = None,
    metadata: Mapping[str, str] | None = None,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Copy a file with other pixels in some channels, all at once or not at all.

    Parameters
    ----------
    source : str or Path
        The file to copy.
    path : str or Path
        The file to write, which stays as it was on an error.
    channels : mapping of int to mapping of str to (H, W) float32 array
        New pixels by the number of the part and the name of the channel. They are of
        the part's data window, or of `window`.
    alone : bool
        Whether all other channels are left out; `channels` are then of one part.
    window : Window, optional
        What the file is cropped to.
    metadata : mapping of str to str, optional
        Added to the headers of the parts that `channels` are of.
    check : callable
        Raises PictureError where `source` was replaced meanwhile: then nothing is
        written.

    Raises
    ------
    PictureError
        If the source cannot be read or cropped, or the file not written.
    """
    planes = {
        part: {k: np.ascontiguousarray(v, np.float32) for k, v in pixels.items()}
        for part, pixels in channels.items()
    }
    with _write_whole(path) as unfinished:
        added = dict(metadata or {})
        openexr_io.copy(
            source, unfinished, planes, alone=alone, window=window, metadata=added
        )
        check()


def write_part(path: str | Path, part: Part) -> None:
    """Write a file of one part, all at once or not at all.

    Parameters
    ----------
    path : str or Path
        The file, which stays as it was on an error.
    part : Part
        Its only part.

    Raises
    ------
    PictureError
        If the file cannot be written.
    """
    with _write_whole(path) as unfinished:
        openexr_io.write_part(unfinished, part)


@contextmanager
def _write_whole(path: str | Path) -> Iterator[Path]:
    try:
        with replacing(Path(path)) as unfinished:
            yield unfinished
    except (OSError, PictureError) as error:
        raise PictureError(f"cannot write {path}: {error}") from error


def attributes(path: str | Path) -> list[Attributes]:
    """Return the attributes of each part; PictureError if the file is not complete."""
    return [part.attributes for part in openexr_io.read(path)]


class File:
    """The channels of a file by full name, such as `ViewLayer.Combined.R`.

    Planes are of the display window, or of `window` where that is set; they are zero
    where the file has no pixels.

    Parameters
    ----------
    path : str or Path
        The file.
    also : mapping of str to Path, optional
        Files that belong to it, which add the channels that it lacks. The only picture
        of such a file is called by the name given with it.

    Raises
    ------
    PictureError
        If a file cannot be read, or has another size.
    """

    def __init__(
        self, path: str | Path, also: Mapping[str, Path] | None = None
    ) -> None:
        self.path = path
        self.parts = openexr_io.read(path)
        self.own_parts = len(self.parts)
        self._places = _locate_channels(path, self.parts)
        for name, other in (also or {}).items():
            self._add(name, other)
        self.names = Channels(path, self._places)
        self.window: Window | None = None
        self.view, self.is_first = "", True

    def views(self) -> list[File]:
        """Return the same file for each of its views, with its channels alone."""
        views: list[File] = []
        for view, places in by_view(self.parts, self._places).items():
            file = copy(self)
            file._places, file.names = places, Channels(self.path, places)
            file.view, file.is_first = view, not views
            views.append(file)
        return views

    def _add(self, name: str, path: Path) -> None:
        parts = openexr_io.read(path)
        if parts[0].display_window != self.parts[0].display_window:
            raise PictureError(f"{path} is no part of {self.path}: its size differs")
        for channel, (part, own) in _locate_channels(path, parts).items():
            full = channel if "." in channel else f"{name}.{channel}"
            self._places.setdefault(full, (len(self.parts) + part, own))
        self.parts += parts

    def place(self, name: str) -> tuple[int, str]:
        """Return the part that a channel lies in, and what it is called there."""
        return self._places[name]

    def pixels(self, name: str) -> Any:
        """Return a channel as it lies in the file."""
        part, own = self._places[name]
        return self.parts[part].channels[own]

    def has(self, wanted: str) -> bool:
        return self.names.find(wanted) is not None

    def colour(self, wanted: str, *, plain: bool = False) -> Array:
        """Return (H, W, 3) of a pass; `plain`: or of R, G, B without a pass."""
        prefix = self.names.find(wanted)
        if prefix is None and plain and self.names.of(""):
            prefix = ""
        if prefix is None:
            raise PictureError(
                f"{self.path} has no pass {wanted!r}; it holds {self.names.contents()}"
            )
        planes = [self.plane(name) for name in self.names.of(prefix)]
        return np.stack(planes, axis=-1)

    def alpha(self, wanted: str) -> Array | None:
        """Return alpha (H, W) of a pass, or the plain one, or None."""
        prefix = self.names.find(wanted)
        name = "A" if prefix is None else f"{prefix}.A"
        return self.plane(name) if name in self.names.names else None

    def plane(self, name: str) -> Array:
        """Return the (H, W) of one channel."""
        part, pixels = self.parts[self.place(name)[0]], self.pixels(name)
        (left, top), (right, bottom) = part.data_window
        size = (bottom - top + 1, right - left + 1)
        if pixels.dtype.kind not in "fu" or pixels.shape != size:
            raise PictureError(
                f"channel {name!r} of {self.path} is deep or subsampled; "
                "save it with flat channels of full resolution"
            )
        return _place_in_window(pixels, part, self.window or part.display_window)


def _locate_channels(path: str | Path, parts: list[Part]) -> dict[str, tuple[int, str]]:
    """Return part and own name of each channel, by its full name.

    Raises PictureError where two parts hold channels of one name.
    """
    places: dict[str, tuple[int, str]] = {}
    for number, part in enumerate(parts):
        # a part with all passes of a view is no layer
        is_view = "view" in part.attributes and any("." in x for x in part.channels)
        layer = part.name if len(parts) > 1 and not is_view else ""
        for name in part.channels:
            # Blender repeats the part's name in its channels, others do not
            full = f"{layer}.{name}" if layer and "." not in name else name
            full = with_view(full, part)
            if full in places:
                first = parts[places[full][0]].name
                raise PictureError(
                    f"{path} holds the channel {full!r} twice, in its parts {first!r} "
                    f"and {part.name!r}; save it with one of them"
                )
            places[full] = number, name
    return places


def _place_in_window(pixels: Any, part: Part, window: Window) -> Array:
    """Return `pixels` of the data window in another one, zero around."""
    (left, top), (right, bottom) = window
    x, y = part.data_window[0]
    size = (bottom - top + 1, right - left + 1)
    if (x, y) == (left, top) and pixels.shape == size:
        return np.asarray(pixels, np.float32)
    picture = np.zeros(size, np.float32)
    rows, source_rows = _find_overlap(y - top, pixels.shape[0], size[0])
    columns, source_columns = _find_overlap(x - left, pixels.shape[1], size[1])
    picture[rows, columns] = pixels[source_rows, source_columns]
    return picture


def _find_overlap(offset: int, length: int, limit: int) -> tuple[slice, slice]:
    """Return where `length` pixels at `offset` go, and which of them."""
    start, stop = max(offset, 0), min(offset + length, limit)
    stop = max(start, stop)
    return slice(start, stop), slice(start - offset, stop - offset)
