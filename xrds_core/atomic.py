"""Files that appear complete or not at all, and cleaning up after killed processes.

A file being written has a name with the machine and the process in it. So a later
process knows whose it was, and whether that one still runs. In the temporary folder a
link of the same name points to it, wherever it is.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from . import children
from .errors import XRDSError

_NAME = re.compile(r"\.xrds-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-\w+\.unfinished")
_DEAD = 3600.0  # seconds without a byte written, after which no machine writes any more
_unfinished: set[Path] = set()
_beginning = threading.Lock()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to; it takes `path`'s place at the end.

    On an error nothing is left of it and `path` is as it was. Any number of threads,
    processes and machines may replace one path at once: it is whole at any time. The
    folder must exist. Of a symbolic link the file that it leads to is replaced.
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
    mark = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
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
        for each in (path, link):  # the link last: it leads to what is left
            if each in _unfinished:
                _remove(each)
                _unfinished.discard(each)


def _is_left(path: Path) -> bool:
    """Whether the process that was writing `path` has ended without removing it."""
    match = _NAME.fullmatch(path.name)
    if match is None:
        return False
    if match["machine"] == _machine() and not _is_running(int(match["process"])):
        return True
    return time.time() - path.lstat().st_mtime > _DEAD


@cache
def _machine() -> str:
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
