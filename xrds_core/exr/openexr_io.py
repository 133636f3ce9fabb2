"""The OpenEXR library, isolated from one that the program itself brings.

On Linux the OpenEXR of a program, Blender for one, lies among its global symbols, and
the dynamic linker gives the Python module those functions in place of its own. With
another version inside, files then cannot be written, and reading them crashes. Where
that is so each file is read and written by a Python process of its own.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..children import run_python
from ..errors import PictureError
from ..files import check_input, scratch_folder
from .raw_header import check_claims, limit_of, readable, restore

Pixels = np.ndarray[Any, Any]

CODECS = (
    *("none", "rle", "zips", "zip", "piz"),
    *("pxr24", "b44", "b44a", "dwaa", "dwab"),  # these lose some of the picture
)
LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class Encoding:
    """How numbers are stored in a file.

    Attributes
    ----------
    half : bool
        16 bits for each number, or else 32.
    codec : str
        Compression, one of CODECS.
    """

    half: bool = False
    codec: str = "zip"

    @property
    def dtype(self) -> Any:
        """NumPy's name of the number format."""
        return np.float16 if self.half else np.float32

    def plane(self, pixels: Pixels) -> Pixels:
        """(H, W) numbers as they are written."""
        return np.ascontiguousarray(fitting(pixels, self.dtype))


FLOAT_ZIP = Encoding()


def fitting(pixels: Pixels, dtype: Any) -> Pixels:
    """Convert pixels to another number format; what half floats cannot hold is clipped.

    Infinity stays infinite.
    """
    if dtype == np.float16:
        bounded = np.clip(pixels, -LARGEST_HALF, LARGEST_HALF)
        pixels = np.where(np.isinf(pixels), pixels, bounded)
    return pixels.astype(dtype, copy=False)


Window = tuple[tuple[int, int], tuple[int, int]]
Attributes = dict[str, Any]
"""Of a header: texts, numbers, matrices as lists of rows, and names of views."""

VIEWS = "multiView"
"""The attribute with the names of a file's views, the one without names first."""
_FAULTS = (RuntimeError, ValueError, TypeError, MemoryError)  # of a damaged file
# Of a header, what a file with other channels has anew.
_OF_CHANNELS = {"channels", "name", "type", "tiles", "chunkCount", "version"}
_LESS = 0.9  # of what DWA may hold, where it is decoded as infinite
_stderr = threading.Lock()


@dataclass(frozen=True)
class Part:
    """One picture of a file; windows are (left, top), (right, bottom), inclusive."""

    name: str
    data_window: Window
    display_window: Window
    channels: dict[str, Pixels]
    """By name: (h, w) of the data window, row 0 on top."""
    attributes: Attributes = field(default_factory=dict)
    """Those of the header that `Attributes` can hold."""


def read(path: str | Path) -> list[Part]:
    """Read all parts of a file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    parts : list of Part
        Parts with their channels.

    Raises
    ------
    PictureError
        If the file is not whole; or if its header claims more than
        `raw_header.limit_of` allows, before memory is allocated.
    """
    limit = limit_of(check_input(Path(path)))
    return _read(path, limit) if not _is_shadowed() else _read_apart(path, limit)


def read_headers(path: str | Path) -> list[Part]:
    """Read all parts of a file without their channels; raises PictureError."""
    check_input(Path(path))
    return _read_headers(path) if not _is_shadowed() else _read_apart(path, 0)


def write(
    path: str | Path,
    planes: Mapping[str, Pixels],
    codec: str = FLOAT_ZIP.codec,
    attributes: Attributes | None = None,
) -> None:
    """Write planes of one size as a file of one part.

    Parameters
    ----------
    path : str or Path
        The file.
    planes : mapping of str to (H, W) array
        Pixels by channel name, in their own number formats.
    codec : str
        Compression, one of CODECS.
    attributes : dict, optional
        Further attributes of the header.

    Raises
    ------
    PictureError
        If the file cannot be written, with the library's reason.
    """
    height, width = next(iter(planes.values())).shape
    window = ((0, 0), (width - 1, height - 1))
    part = Part("", window, window, dict(planes), dict(attributes or {}))
    write_part(path, part, codec)


def write_part(path: str | Path, part: Part, codec: str = FLOAT_ZIP.codec) -> None:
    """Write a file of one part, with its windows and attributes.

    Matrices are written in single precision.

    Parameters
    ----------
    path : str or Path
        The file.
    part : Part
        Its only part.
    codec : str
        Compression, one of CODECS.

    Raises
    ------
    PictureError
        If the file cannot be written, with the library's reason.
    """
    if not _is_shadowed():
        _write(path, part, codec)
        return
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        _pack(archive, [part])
        _run_apart("write", path, archive, codec)


def copy(
    source: str | Path,
    path: str | Path,
    planes: Mapping[int, Mapping[str, Pixels]],
    *,
    alone: bool = False,
    window: Window | None = None,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Copy a file with some channels replaced or added.

    All other channels, the windows and the attributes stay as they are. A plane that
    replaces another gets its number format.

    Parameters
    ----------
    source : str or Path
        The file to copy.
    path : str or Path
        The file to write.
    planes : mapping of int to mapping of str to (H, W) array
        New pixels by the number of the part and the name of the channel.
    alone : bool
        Whether to write only `planes`, which are then of one part, with its windows and
        attributes.
    window : Window, optional
        What all parts are cropped to; `planes` are then of this window.
    metadata : mapping of str to str, optional
        Added to the headers of the parts that `planes` are of.

    Raises
    ------
    PictureError
        If the source cannot be read or cropped, or the file not written.
    """
    limit = limit_of(check_input(Path(source)))
    added = dict(metadata or {})
    if not _is_shadowed():
        _copy(source, path, planes, alone, window, added, limit)
        return
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        unread = ((0, 0), (0, 0))  # the source has them
        options: Attributes = {"source": os.fspath(source), "alone": alone}
        options |= {"window": window, "metadata": added}
        parts = [
            Part("", unread, unread, dict(channels), options | {"part": number})
            for number, channels in planes.items()
        ]
        _pack(archive, parts)
        _run_apart("copy", path, archive, str(limit))


@cache
def _is_shadowed() -> bool:
    """Whether the program's own OpenEXR would be called in the module's place."""
    return sys.platform == "linux" and hasattr(ctypes.CDLL(None), "exr_start_read")


@cache
def _library() -> Any:
    """OpenEXR, on all processors: by itself it reads and writes on one."""
    import OpenEXR

    def start() -> None:
        OpenEXR.set_global_thread_count(os.cpu_count() or 1)

    start()
    if hasattr(os, "register_at_fork"):  # a fork has none of the threads it waits for
        os.register_at_fork(
            before=lambda: OpenEXR.set_global_thread_count(0),
            after_in_parent=start,
            after_in_child=start,
        )
    return OpenEXR


def _read(path: str | Path, limit: int) -> list[Part]:
    parts = _open_file(path, limit).parts
    return [
        _make_part(
            part, {name: channel.pixels for name, channel in part.channels.items()}
        )
        for part in parts
    ]


def _read_headers(path: str | Path) -> list[Part]:
    return [_make_part(part, {}) for part in _read_whole_headers(path)]


def _read_whole_headers(path: str | Path) -> Any:
    try:
        with _silent_library():
            return _read_checked_headers(path)
    except _FAULTS as error:
        raise _incomplete_error(path, error) from error


def _make_part(part: Any, channels: dict[str, Pixels]) -> Part:
    header = part.header
    return Part(
        header.get("name", ""),
        _to_window(header["dataWindow"]),
        _to_window(header["displayWindow"]),
        channels,
        _read_attributes(header),
    )


def _read_checked_headers(path: str | Path, limit: float = math.inf) -> Any:
    openexr = _library()
    with readable(path) as readable_path:
        headers = openexr.File(str(readable_path), header_only=True).parts
    check_claims(path, [part.header for part in headers], limit)
    return headers


def _open_file(path: str | Path, limit: int) -> Any:
    """Return the library's file with all its pixels; PictureError if not whole."""
    openexr = _library()
    try:
        # OpenEXR leaves out a part that it cannot read and says why on stdout
        with _silent_library(), redirect_stdout(StringIO()) as output:
            headers = _read_checked_headers(path, limit)
            with readable(path) as readable_path:
                file = openexr.File(str(readable_path), separate_channels=True)
    except _FAULTS as error:
        raise _incomplete_error(path, error) from error
    if not file.parts or len(file.parts) != len(headers):
        raise _incomplete_error(path, output.getvalue().strip().rpartition(" - ")[2])
    for part in file.parts:
        _bound_ringing(part)
    return file


def _bound_ringing(part: Any) -> None:
    """Bound what DWA decodes as infinite: it rings near the largest half."""
    openexr = _library()
    if part.header["compression"] in (
        openexr.DWAA_COMPRESSION,
        openexr.DWAB_COMPRESSION,
    ):
        for channel in part.channels.values():
            if channel.pixels.dtype == np.float16:
                np.copyto(channel.pixels, _clip(channel.pixels, LARGEST_HALF))


def _clip(pixels: Pixels, most: float) -> Pixels:
    """NaN stays."""
    return np.clip(pixels, -most, most).astype(pixels.dtype, copy=False)


def _incomplete_error(path: str | Path, reason: object) -> PictureError:
    return PictureError(f"{path} is not a complete OpenEXR file ({reason})")


def _read_attributes(header: Mapping[str, Any]) -> Attributes:
    matrices = {
        name: value.tolist()
        for name, value in header.items()
        if isinstance(value, np.ndarray) and value.ndim == 2
    }
    plain = {k: v for k, v in header.items() if type(v) in (str, int, float)}
    views = header.get(VIEWS)
    named = {VIEWS: list(map(str, views))} if isinstance(views, list) else {}
    return plain | named | matrices


@contextmanager
def _silent_library() -> Iterator[None]:
    """Drop what the library's C code prints on stderr; its exceptions say the same."""
    with _stderr:
        try:
            stderr = os.dup(2)
        except OSError:  # closed
            yield
            return
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 2)
        os.close(nothing)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)


def _write(path: str | Path, part: Part, codec: str) -> None:
    openexr = _library()
    compression = "NO" if codec == "none" else codec.upper()
    header = {
        "compression": getattr(openexr, f"{compression}_COMPRESSION"),
        "type": openexr.scanlineimage,
    }
    for name, value in part.attributes.items():
        matrix = isinstance(value, list)
        header[name] = np.asarray(value, np.float32) if matrix else value
    header["dataWindow"] = _to_corners(part.data_window)
    header["displayWindow"] = _to_corners(part.display_window)
    # the library reads other arrays as if they were contiguous
    planes = {name: np.ascontiguousarray(x) for name, x in part.channels.items()}
    try:
        if codec.startswith("dwa"):
            _write_dwa(path, header, planes)
            return
        with _silent_library():
            openexr.File(header, planes).write(str(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise PictureError(str(error)) from error


def _write_dwa(
    path: str | Path, header: dict[str, Any], planes: dict[str, Pixels]
) -> None:
    """Write planes so that they are finite again when they are read.

    DWA stores infinity as 0, and light near the largest half may be decoded as
    infinity: what is, is bounded lower.
    """
    openexr = _library()
    halves = [name for name, x in planes.items() if x.dtype == np.float16]
    most = dict.fromkeys(planes, math.inf) | dict.fromkeys(halves, LARGEST_HALF)
    while True:
        bounded = {name: _clip(x, most[name]) for name, x in planes.items()}
        with _silent_library():
            openexr.File(dict(header), dict(bounded)).write(str(path))
            (read,) = openexr.File(str(path), separate_channels=True).parts
        over = [
            name
            for name, channel in read.channels.items()
            if _is_lost(bounded[name], channel.pixels)
        ]
        if not over:
            return
        most |= {name: min(most[name] * _LESS, LARGEST_HALF) for name in over}


def _is_lost(pixels: Pixels, read: Pixels) -> bool:
    """Whether any light was read as infinite, or infinite light as none."""
    is_finite, black = np.isfinite(pixels), read == 0.0
    return bool((is_finite & np.isinf(read) | np.isinf(pixels) & black).any())


def _copy(
    source: str | Path,
    path: str | Path,
    planes: Mapping[int, Mapping[str, Pixels]],
    alone: bool,
    window: Window | None,
    metadata: Mapping[str, str],
    limit: int,
) -> None:
    openexr = _library()
    if alone:
        ((number, new_channels),) = planes.items()
        whole = _read_whole_headers(source)[number].header
        header = {k: v for k, v in whole.items() if k not in _OF_CHANNELS}
        header["compression"] = _lossless_codec(header["compression"])
        header["type"] = openexr.scanlineimage
        if window is not None:
            header["dataWindow"] = _to_corners(window)
        header |= metadata
        channels: dict[str, Any] = {}
        _set_channels(channels, new_channels)
    else:
        file = _open_file(source, limit)
        if window is not None:
            _crop(file.parts, window)
        for number, new_channels in planes.items():
            _set_channels(file.parts[number].channels, new_channels)
            file.parts[number].header |= metadata
    try:
        if alone:
            file = openexr.File(header, channels)
        else:
            _make_writable(file.parts)
        with _silent_library():
            file.write(str(path))
        restore(source, path)
    except (OSError, RuntimeError, ValueError) as error:
        raise PictureError(str(error)) from error


def _crop(parts: Any, window: Window) -> None:
    """Leave of each part what lies in a window; raises PictureError where it cannot."""
    (left, top), (right, bottom) = window
    for part in parts:
        (x, y), (last_x, last_y) = _to_window(part.header["dataWindow"])
        if left < x or top < y or right > last_x or bottom > last_y:
            raise PictureError(
                f"a part of it does not cover the crop, {part.header.get('name', '')!r}"
            )
        for channel in part.channels.values():
            if (channel.xSampling, channel.ySampling) != (1, 1):
                raise PictureError(
                    f"channel {channel.name} has pixels left out: it cannot be cropped"
                )
            inner = channel.pixels[top - y : bottom - y + 1, left - x : right - x + 1]
            channel.pixels = np.ascontiguousarray(inner)
        part.header["dataWindow"] = _to_corners(window)


def _to_corners(window: Window) -> tuple[Any, Any]:
    """Return a window in the form that the library takes."""
    first, last = (np.array(corner, np.int32) for corner in window)
    return first, last


def _set_channels(channels: dict[str, Any], planes: Mapping[str, Pixels]) -> None:
    """Replace or add channels of a part."""
    openexr = _library()
    for name, pixels in planes.items():
        old = channels[name].pixels if name in channels else None
        if old is not None and old.dtype.kind == "f":
            old[...] = fitting(pixels, old.dtype)
        else:  # no integers, in which light would be cut to 0
            channels[name] = openexr.Channel(name, np.ascontiguousarray(pixels))


def _make_writable(parts: Any) -> None:
    """Bring parts into a form that the library can write.

    Smaller levels of a texture would be those of the noisy picture, and the library
    writes none; nor does it write channels of different sizes, so that their values are
    repeated.
    """
    openexr = _library()
    for part in parts:
        part.header["compression"] = _lossless_codec(part.header["compression"])
        if "tiles" in part.header:
            tiles = part.header["tiles"]
            tiles.mode = openexr.ONE_LEVEL
            part.header["tiles"] = tiles
        for name, channel in part.channels.items():
            across, down = channel.xSampling, channel.ySampling
            if (across, down) != (1, 1):
                part.channels[name] = openexr.Channel(
                    name, _repeat_pixels(channel.pixels, across, down, part)
                )


def _lossless_codec(compression: Any) -> Any:
    """Return ZIP in place of codecs that would lose some of all channels again."""
    openexr = _library()
    lossy = ("B44", "B44A", "DWAA", "DWAB")
    losses = [getattr(openexr, f"{name}_COMPRESSION") for name in lossy]
    return openexr.ZIP_COMPRESSION if compression in losses else compression


def _repeat_pixels(pixels: Pixels, across: int, down: int, part: Any) -> Pixels:
    (left, top), (right, bottom) = _to_window(part.header["dataWindow"])
    whole = pixels.repeat(down, axis=0).repeat(across, axis=1)
    return np.ascontiguousarray(whole[: bottom - top + 1, : right - left + 1])


def _to_window(corners: Any) -> Window:
    (left, top), (right, bottom) = corners
    return (int(left), int(top)), (int(right), int(bottom))


def _read_apart(path: str | Path, limit: int) -> list[Part]:
    """Read all parts, without a limit their headers alone."""
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        _run_apart("read" if limit else "headers", path, archive, str(limit))
        return _unpack(archive)


def _run_apart(task: str, path: str | Path, archive: Path, how: str) -> None:
    """Do a task in a process without the program's library."""
    words = (task, os.fspath(path), str(archive), how)
    done = run_python("-m", __name__, *words, path=sys.path)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
        raise PictureError(lines[-1])


def _pack(archive: Path, parts: list[Part]) -> None:
    heads: list[dict[str, Any]] = []
    arrays: dict[str, Pixels] = {}
    for number, part in enumerate(parts):
        heads.append({**vars(part), "channels": list(part.channels)})
        arrays |= {
            f"{number}.{index}": pixels
            for index, pixels in enumerate(part.channels.values())
        }
    np.savez(archive, heads=np.array(json.dumps(heads)), **arrays)


def _unpack(archive: Path) -> list[Part]:
    with np.load(archive) as stored:
        return [
            Part(
                head["name"],
                _to_window(head["data_window"]),
                _to_window(head["display_window"]),
                {
                    name: stored[f"{number}.{index}"]
                    for index, name in enumerate(head["channels"])
                },
                head["attributes"],
            )
            for number, head in enumerate(json.loads(str(stored["heads"])))
        ]


def _main(task: str, path: str, archive: str, how: str) -> int:
    """Do a task; `how` is the limit of what is read, or the codec of what is not."""
    try:
        if task == "read":
            _pack(Path(archive), _read(path, int(how)))
            return 0
        if task == "headers":
            _pack(Path(archive), _read_headers(path))
            return 0
        parts = _unpack(Path(archive))
        if task == "write":
            _write(path, parts[0], how)
        else:
            options = parts[0].attributes
            planes = {part.attributes["part"]: part.channels for part in parts}
            window = options["window"] and _to_window(options["window"])
            chosen = options["alone"], window, options["metadata"]
            _copy(options["source"], path, planes, *chosen, int(how))
    except PictureError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
