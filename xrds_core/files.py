"""Files that appear complete or not at all, and checks of places before the work."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import secrets
import select
import shutil
import stat
import tempfile
import threading
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from . import children
from .errors import PictureError, UsageError, XRDSError

_NAME = re.compile(r"\.xrds-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-\w+\.unfinished")
_DEAD = 3600.0  # seconds without a byte written, after which no machine writes any more
_unfinished: set[Path] = set()
_beginning = threading.Lock()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to; it takes `path`'s place at the end.

    On an error nothing is left of it and `path` is as it was. Any number of threads,
    processes and machines may replace one path at once: it is whole at any time.

    Parameters
    ----------
    path : Path
        The file, in an existing folder. Of a symbolic link the file that it leads to is
        replaced.

    Yields
    ------
    unfinished : Path
        The path to write to.

    Raises
    ------
    OSError
        If the path is no regular file, or cannot be written.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    # not from tempfile: its files are readable by their owner alone
    with _registered(path.parent) as unfinished:
        yield unfinished
        unfinished.replace(path)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a new folder among the temporary ones, which is removed at the end."""
    with _registered(Path(tempfile.gettempdir())) as folder:
        folder.mkdir(mode=0o700)
        yield folder


def write_json(path: Path, value: Any) -> None:
    """Write a value as a JSON file for people to read too, whole or not at all."""
    with replacing(path) as part:
        part.write_text(json.dumps(value, indent=1) + "\n", "utf-8")


def read_json(path: Path) -> Any:
    """Read a JSON file of an earlier run; raises XRDSError if it is damaged."""
    try:
        return json.loads(path.read_text("utf-8"))
    except ValueError as error:
        raise XRDSError(
            f"{path} is damaged ({error}); remove it to begin anew"
        ) from error


def try_folder(folder: Path) -> None:
    """Make `folder` and, for a moment, a file in it; raises OSError if it cannot."""
    folder.mkdir(parents=True, exist_ok=True)
    with _registered(folder) as probe:
        probe.touch(exist_ok=False)


def abandon() -> None:
    """Remove what this process is writing: it is about to end on the spot.

    Nothing new can be begun from now on: whoever tries waits for the end.
    """
    _beginning.acquire()
    children.kill_all()
    for path in list(_unfinished):
        _remove(path)


def sweep(folder: Path | None = None) -> None:
    """Remove what processes left that were killed while they wrote.

    That is what lies in `folder`; without one, in the temporary folder and wherever
    its links lead.
    """
    for path in (folder or Path(tempfile.gettempdir())).glob(".xrds-*.unfinished"):
        with suppress(OSError):  # another sweep may be at it
            if not _is_left(path):
                continue
            target = path.readlink() if path.is_symlink() else None
            if target and target.name == path.name:
                _remove(target)
            _remove(path)


@contextmanager
def _registered(folder: Path) -> Iterator[Path]:
    """Yield a new path in `folder`; what lies there at the end is removed."""
    mark = f"{_identify_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
    path = folder / f".xrds-{mark}.unfinished"
    link = Path(tempfile.gettempdir(), path.name)
    with _beginning:
        _unfinished.add(path)
        if link.parent != folder:
            with suppress(OSError):  # no permission or no links: `folder` is swept
                link.symlink_to(path.absolute())
                _unfinished.add(link)
    try:
        yield path
    finally:
        for leftover in (path, link):  # the link last: it leads to what is left
            if leftover in _unfinished:
                _remove(leftover)
                _unfinished.discard(leftover)


def _is_left(path: Path) -> bool:
    """Whether the process that was writing `path` has ended without removing it."""
    match = _NAME.fullmatch(path.name)
    if match is None:
        return False
    if match["machine"] == _identify_machine() and not _is_running(
        int(match["process"])
    ):
        return True
    return time.time() - path.lstat().st_mtime > _DEAD


@cache
def _identify_machine() -> str:
    """The processes whose numbers can be compared: of one system since its start."""
    try:
        started = Path("/proc/sys/kernel/random/boot_id").read_text("utf-8")
        numbering = Path("/proc/self/ns/pid").readlink()  # another in each container
    except OSError:
        started, numbering = str(uuid.getnode()), Path()
    text = f"{started} {numbering}".encode()
    return hashlib.blake2b(text, digest_size=4).hexdigest()


def _is_running(process: int) -> bool:
    """Whether a process has this number; True where that cannot be checked."""
    if os.name == "nt":  # os.kill would end it
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def _remove(path: Path) -> None:
    with suppress(OSError):  # what was written to may have vanished
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


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
    """Return what a file or a pipe holds.

    Parameters
    ----------
    path : Path
        The file or pipe.
    most : int
        Most bytes.

    Returns
    -------
    data : bytes

    Raises
    ------
    UsageError
        If it cannot be read, holds more, or is a pipe into which nobody writes.
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

    The folder is made, and what killed processes left in it is removed.

    Parameters
    ----------
    path : Path
        The file to write.
    inputs : iterable of str or Path
        Files that the work reads.

    Raises
    ------
    PictureError
        If the file cannot be written, or is an input.
    """
    check_places([path], inputs)
    check_folder(Path(os.path.realpath(path)).parent)


def check_places(paths: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """Refuse files that cannot be written, inputs, and two names of one file.

    Parameters
    ----------
    paths : iterable of Path
        Files to write.
    inputs : iterable of str or Path
        Files that the work reads.

    Raises
    ------
    PictureError
        If one of them must not be written.
    """
    read = {_identity(file) for file in inputs} - {None}
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
