"""Checks before the work: whether files can be read and written."""

from __future__ import annotations

import os
import select
import stat
import time
from collections.abc import Iterable
from pathlib import Path

from .atomic import sweep, try_folder
from .errors import PictureError, UsageError, XRDSError


def check_input(path: Path, error: type[XRDSError] = PictureError) -> int:
    """Return the bytes of a file; raise `error`, saying why, if it cannot be read."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise error(f"cannot read {path}: it is no regular file")
        with path.open("rb") as file:
            return os.fstat(file.fileno()).st_size
    except FileNotFoundError as reason:
        raise error(f"no file {path}") from reason
    except OSError as reason:
        raise error(f"cannot read {path} ({reason.strerror})") from reason


_WAIT = 10.0  # seconds for somebody to write into a pipe


def read_stream(path: Path, most: int) -> bytes:
    """Return what a file or a pipe holds, up to `most` bytes.

    Raises UsageError where it cannot be read, holds more, or is a pipe into which
    nobody writes.
    """
    try:
        # else a pipe waits for ever for somebody who opens its other end
        flags = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        file = os.open(path, os.O_RDONLY | flags)
        with os.fdopen(file, "rb", buffering=0) as stream:
            data = _read_up_to(stream.fileno(), most + 1)
    except FileNotFoundError as error:
        raise UsageError(f"no file {path}") from error
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) > most:
        raise UsageError(f"cannot read {path}: it holds more than {most >> 20} MB")
    return data


def _read_up_to(file: int, most: int) -> bytes:
    is_pipe = stat.S_ISFIFO(os.fstat(file).st_mode)
    parts, size, end = [], 0, time.monotonic() + _WAIT
    while size < most:
        try:
            part = os.read(file, min(most - size, 1 << 20))
        except BlockingIOError:  # somebody has it open, and has yet to write
            select.select([file], [], [])
            continue
        if part:
            parts.append(part)
            size += len(part)
        elif not is_pipe or parts:
            break
        elif time.monotonic() > end:
            raise TimeoutError(f"nobody writes into this pipe for {_WAIT:.0f} seconds")
        else:
            time.sleep(0.05)
    return b"".join(parts)


def check_output(path: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Refuse a file that cannot be written, and an input of the work as its output.

    Makes the folder, and sweeps up what killed processes left in it. Raises
    PictureError.
    """
    check_places([path], inputs)
    check_folder(Path(os.path.realpath(path)).parent)


def check_places(paths: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """As `check_place` of many; none may be an input, nor two the same file."""
    read = {_identity(each) for each in inputs} - {None}
    written: dict[str, Path] = {}
    for path in paths:
        check_place(path)
        other = written.setdefault(os.path.realpath(path), path)
        reason = "it is an input" if _identity(path) in read else ""
        if other is not path:
            reason = f"{other} leads to the same file"
        if reason:
            raise PictureError(f"cannot write {path}: {reason}; choose another output")


def _identity(path: str | Path) -> tuple[int, int] | None:
    """What is the same for all names of one file; None where there is none."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def check_place(path: Path) -> None:
    """Raise PictureError for a path that names no file, or one not to be replaced.

    Those are devices, pipes and sockets, also behind a link, and read-only files.
    """
    reason = ""
    try:
        os.fspath(path).encode()
        kind = path.stat().st_mode
        if stat.S_ISDIR(kind):
            reason = "it is a folder"
        elif not stat.S_ISREG(kind):
            reason = "it is no regular file"
        elif not os.access(path, os.W_OK):
            reason = "it is read-only"
    except FileNotFoundError:  # as it is to be
        reason = "it is a link that leads nowhere" if path.is_symlink() else ""
    except UnicodeEncodeError:
        reason = "its name is not UTF-8"
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise PictureError(f"cannot write {path} ({reason}); choose another output")


def check_folder(folder: Path) -> None:
    """Make a folder; raise PictureError if no file can be written to it.

    What killed processes left in it is swept up.
    """
    try:
        try_folder(folder)
    except OSError as error:
        raise PictureError(
            f"cannot write into {folder} ({error.strerror}); choose another output"
        ) from error
    sweep(folder)
