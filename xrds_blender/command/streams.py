"""stdout and stderr: moved aside, closed by the shell, or full.

Cycles prints from C, so file descriptors are moved and not Python's streams alone.
"""

from __future__ import annotations

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_aside: int | None = None  # where stdout really leads, while it is moved


class _Stream(io.FileIO):
    """A stream whose faults stop no work; `fault` is the first one."""

    fault: OSError | None = None

    def write(self, data: Any) -> int:
        if self.fault is None:
            try:
                return super().write(data)
            except OSError as error:  # full, closed, or nobody reads it any more
                self.fault = error
        return len(data)


def prepare() -> None:
    """Make the streams safe to print on, whatever the shell has made of them.

    A closed one would give its number to the next file that is opened, and Cycles would
    print into that. As in GNU's tools the null device comes in its place, opened the
    other way round so that writing still fails and is reported.
    """
    for number, mode in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_RDONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, mode)  # takes the lowest number that is free
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(
            io.BufferedWriter(_Stream(number, "w", closefd=False)),
            encoding=getattr(before, "encoding", None) or "utf-8",
            errors="backslashreplace",
            line_buffering=number == 2 or os.isatty(number),
        )
        for number, before in ((1, sys.stdout), (2, sys.stderr))
    )


def fault() -> OSError | None:
    """Why stdout did not take all that was printed, None if it did."""
    flush_all()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.fault if isinstance(raw, _Stream) else None


def flush_all() -> None:
    """Flush what Python and the C library still hold of stdout and stderr."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # full, closed, None
            stream.flush()
    if os.name != "nt":  # Windows' C libraries keep one buffer each
        ctypes.CDLL(None).fflush(None)


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Let all that is printed on stdout go to stderr, so that a result has it alone."""
    global _aside
    with _moved() as _aside:
        os.dup2(2, 1)
        yield
    _aside = None


@contextmanager
def stdout_to(path: Path) -> Iterator[None]:
    """Append what is printed on stdout to a file."""
    with _moved(), path.open("ab") as file:
        os.dup2(file.fileno(), 1)
        yield


def write_at_once(text: str, result: str) -> None:
    """Write to stderr, and `result` to stdout where it waits for one, without buffers.

    For a process that is about to end on the spot.
    """
    for number, each in ((2, text), (_aside, result)):
        if number is not None:
            with suppress(OSError):  # the terminal may have gone
                os.write(number, each.encode())


@contextmanager
def _moved() -> Iterator[int]:
    """Yield a copy of stdout's descriptor, which is put back at the end."""
    flush_all()
    saved = os.dup(1)
    try:
        yield saved
    finally:
        flush_all()
        os.dup2(saved, 1)
        os.close(saved)
