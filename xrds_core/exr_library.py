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
from dataclasses import asdict, dataclass
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

_LARGEST_SIDE = 1 << 16  # pixels; more is a damaged header


@dataclass(frozen=True)
class Part:
    """One picture of a file; windows are (left, top), (right, bottom), inclusive."""

    name: str
    data_window: Window
    display_window: Window
    channels: dict[str, Pixels]
    """By name: (h, w) of the data window, row 0 on top."""


def read(path: str | Path) -> list[Part]:
    """Read all parts of a file; raises PictureError if it is not whole."""
    if not _is_shadowed():
        return _read(path)
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        _apart("read", path, archive)
        return _unpack(archive)


def write(path: str | Path, planes: Mapping[str, Pixels]) -> None:
    """Write planes of one size by channel name, in their own number formats.

    Raises PictureError with the library's reason if they cannot be written.
    """
    if not _is_shadowed():
        _write(path, planes)
        return
    with scratch_folder() as folder:
        archive = folder / "parts.npz"
        window = ((0, 0), (0, 0))  # not read: the planes have their own size
        _pack(archive, [Part("", window, window, dict(planes))])
        _apart("write", path, archive)


@cache
def _is_shadowed() -> bool:
    """Whether the program's own OpenEXR would be called in the module's place."""
    return sys.platform == "linux" and hasattr(ctypes.CDLL(None), "exr_start_read")


def _read(path: str | Path) -> list[Part]:
    import OpenEXR

    try:
        headers = OpenEXR.File(str(path), header_only=True).parts
        for part in headers:
            _check_windows(path, part.header)
        # OpenEXR leaves out a part that it cannot read and says why on stdout
        with redirect_stdout(StringIO()) as output:
            parts = OpenEXR.File(str(path), separate_channels=True).parts
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        raise PictureError(
            f"{path} is not a complete OpenEXR file ({error})"
        ) from error
    if not parts or len(parts) != len(headers):
        reason = output.getvalue().strip().rpartition(" - ")[2]
        raise PictureError(f"{path} is not a complete OpenEXR file ({reason})")
    return [
        Part(
            part.header.get("name", ""),
            _window(part.header["dataWindow"]),
            _window(part.header["displayWindow"]),
            {name: channel.pixels for name, channel in part.channels.items()},
        )
        for part in parts
    ]


def _write(path: str | Path, planes: Mapping[str, Pixels]) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        OpenEXR.File(header, dict(planes)).write(str(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise PictureError(str(error)) from error


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
        heads.append({**asdict(part), "channels": list(part.channels)})
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
            )
            for number, head in enumerate(json.loads(str(stored["heads"])))
        ]


def _main(task: str, path: str, archive: str) -> int:
    try:
        if task == "read":
            _pack(Path(archive), _read(path))
        else:
            _write(path, _unpack(Path(archive))[0].channels)
    except PictureError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
