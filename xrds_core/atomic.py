"""Files that appear whole or not at all."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_SUFFIX = ".unfinished"
_DEAD = 3600.0  # seconds without a byte written, after which nobody is writing any more
_unfinished: set[Path] = set()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to; it takes `path`'s place at the end.

    On an error nothing is left of it and `path` is as it was. Any number of threads,
    processes and machines may replace one path at once: it is whole at any time. The
    folder must exist.
    """
    # not from tempfile: its files are readable by their owner alone
    unfinished = path.with_name(f".{path.name}.{secrets.token_hex(6)}{_SUFFIX}")
    _unfinished.add(unfinished)
    try:
        yield unfinished
        unfinished.replace(path)
    except BaseException:
        _remove(unfinished)
        raise
    finally:
        _unfinished.discard(unfinished)


def write_json(path: Path, value: Any) -> None:
    """Write a value as a JSON file for people to read too, whole or not at all."""
    with replacing(path) as part:
        part.write_text(json.dumps(value, indent=1) + "\n", "utf-8")


def abandon() -> None:
    """Remove what this process is writing now: it is about to end on the spot."""
    for path in list(_unfinished):
        _remove(path)


def sweep(folder: Path) -> None:
    """Remove from `folder` what processes left that were killed while they wrote."""
    for path in folder.glob(f".*{_SUFFIX}"):
        with suppress(OSError):  # another sweep may be at it
            if time.time() - path.stat().st_mtime > _DEAD:
                path.unlink()


def _remove(path: Path) -> None:
    with suppress(OSError):  # what was written to may have vanished
        path.unlink()
