"""Work on all processors: the library, as NumPy, lets other threads run meanwhile."""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor, wait
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

    `threads`: all processors by default. No thread works any more when this ends, by an
    interrupt or several as well: what it writes into is freed then.
    """
    count = min(threads or processors(), len(items))
    if count <= 1:
        return [work(item) for item in items]
    pool = ThreadPoolExecutor(count)
    futures: list[Future[Result]] = []
    try:
        for item in items:
            futures.append(pool.submit(work, item))  # noqa: PERF401 (an interrupt keeps it)
        return [future.result() for future in futures]
    finally:
        try:
            _end(futures)
        finally:
            pool.shutdown()


def _end(futures: Sequence[Future[Result]]) -> None:
    """Cancel what has not begun and wait for the rest, however often interrupted.

    Threads cannot be joined for that: one whose join was interrupted counts as ended.
    """
    interrupt: KeyboardInterrupt | None = None
    left = futures
    while left:
        try:
            for future in left:
                future.cancel()
            wait(left)
            left = [future for future in left if not future.done()]
        except KeyboardInterrupt as again:
            interrupt = again
    if interrupt is not None:
        raise interrupt


def bands(height: int) -> list[tuple[int, int]]:
    """Return the rows of a picture in bands: first and last (excluded)."""
    return [(top, min(top + _ROWS, height)) for top in range(0, height, _ROWS)]
