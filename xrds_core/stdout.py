"""stdout moved aside while a library prints on it.

Libraries print from C, so the file descriptor is moved and not Python's stream alone.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


def flush_all() -> None:
    """Flush what Python and the C library still hold of stdout and stderr."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # full, closed, None
            stream.flush()
    if os.name != "nt":  # Windows' C libraries keep one buffer each
        ctypes.CDLL(None).fflush(None)


@contextmanager
def moved() -> Iterator[int]:
    """Yield a copy of stdout's descriptor, which is put back at the end."""
    flush_all()
    kept = os.dup(1)
    try:
        yield kept
    finally:
        flush_all()
        os.dup2(kept, 1)
        os.close(kept)


@contextmanager
def muted() -> Iterator[None]:
    """Let nothing be printed on stdout."""
    with moved():
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.close(null)
        yield
