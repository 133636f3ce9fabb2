"""Work on all processors: the library, as NumPy, lets other threads run meanwhile."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Item = TypeVar("Item")
Result = TypeVar("Result")

_ROWS = 128  # of a band


def processors() -> int:
    """Return how many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(
    work: Callable[[Item], Result], items: Sequence[Item], threads: int | None = None
) -> list[Result]:
    """Return the results of `work`, in the order of the items.

    `threads`: all processors by default.
    """
    count = min(threads or processors(), len(items))
    if count <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, items))


def bands(height: int) -> list[tuple[int, int]]:
    """Return the rows of a picture in bands: first and last (excluded)."""
    return [(top, min(top + _ROWS, height)) for top in range(0, height, _ROWS)]
