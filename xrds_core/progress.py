"""How far work has come, for a callback that may cancel it, and what is left of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from .errors import Cancelled

Callback = Callable[[float], object]
"""Takes a fraction in [0, 1] that never falls; False as its result cancels."""

_NEARLY = 0.999  # 1 is reported once, when all is done


class Progress:
    """Reports the fraction done of all work to a callback; it never falls.

    Work is counted by `begin` and `add`, or consists of stages that tell their own
    fractions, by `begin_stage` and `monitor`.

    Parameters
    ----------
    callback : callable or None
        Takes a fraction in [0, 1]; False as its result cancels.

    Raises
    ------
    Cancelled
        By any method that reports, if the callback says so.
    """

    def __init__(self, callback: Callback | None) -> None:
        self._callback = callback
        self._reported = 0.0
        self._start = self._share = 0.0  # of the stage
        self._is_cancelled = False
        self.begin(1.0)

    def begin(self, total: float) -> None:
        """Begin with work of `total`, or begin anew; what was reported stays."""
        self._total = total
        self._done = 0.0

    def add(self, work: float) -> None:
        self._done += work
        self.report(min(self._done / self._total, _NEARLY))

    def begin_stage(self, share: float) -> None:
        """Begin a stage that is `share` of all the work."""
        self._start, self._share = self._start + self._share, share

    def monitor(self, fraction: float) -> bool:
        """Take a stage's own fraction; False as the result stops it."""
        with suppress(Cancelled):
            self.report(min(self._start + self._share * fraction, _NEARLY))
        return not self._is_cancelled

    def check(self) -> None:
        """Raise Cancelled if a stage was stopped."""
        if self._is_cancelled:
            raise Cancelled

    def report(self, fraction: float) -> None:
        """Report the fraction of all the work."""
        self._reported = max(self._reported, fraction)
        if self._callback is not None and self._callback(self._reported) is False:
            self._is_cancelled = True
            raise Cancelled


class Clock:
    """Measures frames, or other pieces that take about equally long."""

    def __init__(self) -> None:
        self._done = 0
        self._start = self._last = time.perf_counter()

    def lap(self, left: int) -> str:
        """Return it for the piece that was just finished; `left` are still to come."""
        now = time.perf_counter()
        took, self._last = now - self._last, now
        self._done += 1
        if not left:
            return f"{took:.1f} s"
        rest = duration((now - self._start) / self._done * left)
        return f"{took:.1f} s; {left} left, about {rest}"


def duration(seconds: float) -> str:
    """Seconds as a person reads them: 4.2 s, 45 s, 12 min, 3.4 h."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes / 60:.1f} h"
