"""The OpenEXR library, kept apart from one that the program itself brings.

On Linux the OpenEXR of a program, Blender for one, lies among its global symbols, and
the dynamic linker gives the Python module those functions in place of its own. With
another version inside, files then cannot be written, and reading them crashes. Where
that is so each file is read and written by a Python process of its own.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import scratch_folder
from .children import run_python
from .errors import PictureError

Pixels = np.ndarray[Any, Any]
Window = tuple[tuple[int, int], tuple[int, int]]
Attributes = dict[str, Any]
"""Of a header: texts, numbers, and matrices as lists of rows."""

_LARGEST_SIDE = 1 << 16  # pixels; more is a damaged header
_LARGEST_HALF = 65504.0
_FAULTS = (RuntimeError, ValueError, TypeError, MemoryError)  # of a damaged file
# Of a header, what a file with other channels has anew.
_OF_CHANNELS = {"channels", "name", "type", "tiles", "chunkCount", "version"}


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
    """Read all parts of a file; raises PictureError if it is not whole."""
    return _read(path) if not _is_shadowed() else _read_apart("read", path)


def read_headers(path: str | Path) -> list[Part]:
    """Read all parts of a file without their channels; raises PictureError."""
    return _read_headers(path) if not _is_shadowed() else _read_apart("headers", path)


def write(path: str | Path, planes: Mapping[str, Pixels]) -> None:
    """Write planes of one size by channel name, in their own number formats.

    Raises PictureError with the library's reason if they cannot be written.
    """
    height, width = next(iter(planes.values())).shape
    window = ((0, 0), (width - 1, height - 1))
    write_part(path, Part("", window, window, dict(planes)))


def write_part(path: str | Path, part: Part) -> None:
    """Write a file of one part, with its windows and attributes.

    Matrices are written in single precision. Raises PictureError as `write`.
    """
    if not _is_shadowed():
        _write(path, part)
        return
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        _pack(archive, [part])
        _apart("write", path, archive)


def copy(
    source: str | Path,
    path: str | Path,
    planes: Mapping[str, Pixels],
    *,
    part: int = 0,
    alone: bool = False,
) -> None:
    """Write `source` to `path` with some channels of one part replaced or added.

    All others, the windows and attributes stay as they are; a plane that replaces
    another takes its number format. `alone`: nothing but `planes` is written, beside
    the part's windows and attributes. Raises PictureError.
    """
    if not _is_shadowed():
        _copy(source, path, planes, part, alone)
        return
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        window = ((0, 0), (0, 0))  # not read: the source has them
        told = {"source": os.fspath(source), "part": part, "alone": alone}
        _pack(archive, [Part("", window, window, dict(planes), told)])
        _apart("copy", path, archive)


@cache
def _is_shadowed() -> bool:
    """Whether the program's own OpenEXR would be called in the module's place."""
    return sys.platform == "linux" and hasattr(ctypes.CDLL(None), "exr_start_read")


def _read(path: str | Path) -> list[Part]:
    parts = _opened(path).parts
    return [
        _part(each, {name: x.pixels for name, x in each.channels.items()})
        for each in parts
    ]


def _read_headers(path: str | Path) -> list[Part]:
    try:
        return [_part(each, {}) for each in _headers(path)]
    except _FAULTS as error:
        raise _incomplete(path, error) from error


def _part(part: Any, channels: dict[str, Pixels]) -> Part:
    header = part.header
    return Part(
        header.get("name", ""),
        _window(header["dataWindow"]),
        _window(header["displayWindow"]),
        channels,
        _attributes(header),
    )


def _headers(path: str | Path) -> Any:
    import OpenEXR

    headers = OpenEXR.File(str(path), header_only=True).parts
    for part in headers:
        _check_windows(path, part.header)
    return headers


def _opened(path: str | Path) -> Any:
    """Return the library's file with all its pixels; PictureError if not whole."""
    import OpenEXR

    try:
        headers = _headers(path)
        # OpenEXR leaves out a part that it cannot read and says why on stdout
        with redirect_stdout(StringIO()) as output:
            file = OpenEXR.File(str(path), separate_channels=True)
    except _FAULTS as error:
        raise _incomplete(path, error) from error
    if not file.parts or len(file.parts) != len(headers):
        raise _incomplete(path, output.getvalue().strip().rpartition(" - ")[2])
    return file


def _incomplete(path: str | Path, reason: object) -> PictureError:
    return PictureError(f"{path} is not a complete OpenEXR file ({reason})")


def _attributes(header: Mapping[str, Any]) -> Attributes:
    matrices = {
        name: value.tolist()
        for name, value in header.items()
        if isinstance(value, np.ndarray) and value.ndim == 2
    }
    plain = {k: v for k, v in header.items() if type(v) in (str, int, float)}
    return plain | matrices


def _write(path: str | Path, part: Part) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for name, value in part.attributes.items():
        matrix = isinstance(value, list)
        header[name] = np.asarray(value, np.float32) if matrix else value
    for name in ("data_window", "display_window"):
        corners = tuple(np.array(x, np.int32) for x in getattr(part, name))
        header["dataWindow" if name == "data_window" else "displayWindow"] = corners
    # the library reads other arrays as if they were contiguous
    planes = {name: np.ascontiguousarray(x) for name, x in part.channels.items()}
    try:
        OpenEXR.File(header, planes).write(str(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise PictureError(str(error)) from error


def _copy(
    source: str | Path,
    path: str | Path,
    planes: Mapping[str, Pixels],
    number: int,
    alone: bool,
) -> None:
    import OpenEXR

    file = _opened(source)
    part = file.parts[number]
    channels = {} if alone else part.channels
    for name, pixels in planes.items():
        if name in channels:
            old = channels[name].pixels
            old[...] = _fitting(pixels, old.dtype)
        else:
            channels[name] = OpenEXR.Channel(name, np.ascontiguousarray(pixels))
    try:
        if alone:
            header = {k: v for k, v in part.header.items() if k not in _OF_CHANNELS}
            header["type"] = OpenEXR.scanlineimage
            file = OpenEXR.File(header, channels)
        file.write(str(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise PictureError(str(error)) from error


def _fitting(pixels: Pixels, dtype: Any) -> Pixels:
    """Return pixels in another number format, cut to what a half float can hold."""
    if dtype == np.float16:
        pixels = np.clip(pixels, -_LARGEST_HALF, _LARGEST_HALF)
    return pixels.astype(dtype)


def _window(corners: Any) -> Window:
    (left, top), (right, bottom) = corners
    return (int(left), int(top)), (int(right), int(bottom))


def _check_windows(path: str | Path, header: Any) -> None:
    for name in ("dataWindow", "displayWindow"):
        least, most = _window(header[name])
        sides = [b - a + 1 for a, b in zip(least, most, strict=True)]
        if not all(0 < side <= _LARGEST_SIDE for side in sides):
            raise PictureError(
                f"{path} is damaged: its {name} is {sides[0]}x{sides[1]} pixels"
            )


def _read_apart(task: str, path: str | Path) -> list[Part]:
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        _apart(task, path, archive)
        return _unpack(archive)


def _apart(task: str, path: str | Path, archive: Path) -> None:
    """Do a task in a process without the program's library."""
    done = run_python("-m", __name__, task, os.fspath(path), str(archive))
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
                _window(head["data_window"]),
                _window(head["display_window"]),
                {
                    name: stored[f"{number}.{index}"]
                    for index, name in enumerate(head["channels"])
                },
                head["attributes"],
            )
            for number, head in enumerate(json.loads(str(stored["heads"])))
        ]


def _main(task: str, path: str, archive: str) -> int:
    try:
        if task == "read":
            _pack(Path(archive), _read(path))
            return 0
        if task == "headers":
            _pack(Path(archive), _read_headers(path))
            return 0
        (part,) = _unpack(Path(archive))
        if task == "write":
            _write(path, part)
        else:
            told = part.attributes
            source, number, alone = told["source"], told["part"], told["alone"]
            _copy(source, path, part.channels, number, alone)
    except PictureError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
