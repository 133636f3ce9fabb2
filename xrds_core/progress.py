"""How far work has come, for a callback that may cancel it, and what is left of it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from statistics import median

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
        rest = (now - self._start) / self._done * left
        return f"{took:.1f} s{what_is_left(left, rest)}"


def what_is_left(count: int, seconds: float | None) -> str:
    """Return how many pieces are left, to end a line; nothing after the last one."""
    if not count:
        return ""
    time_left = "" if seconds is None else f", about {duration(seconds)}"
    return f"; {count} left{time_left}"


_NEWEST = 5  # pieces whose median is expected of the next: a few are far dearer


class _Work:
    """Pieces of one kind of work: how many are left, and the seconds of one."""

    def __init__(self, left: int, seconds: float | None) -> None:
        self.left, self.seconds = left, seconds
        self._newest: deque[float] = deque(maxlen=_NEWEST)

    def add(self, seconds: float) -> None:
        self.left = max(self.left - 1, 0)
        self._newest.append(seconds)
        self.seconds = median(self._newest)


class ShotClock:
    """Tells the seconds left of a shot: each frame is sampled, and later finished.

    Wall-clock time between two calls counts for the kind of work that the second one
    notes: so what else goes on is part of it.

    Parameters
    ----------
    to_sample, to_finish : int
        Frames that are to be sampled, and to be finished.
    finishing : float or None
        Expected seconds of finishing a frame, until the first one is finished.
    now : callable
        Returns seconds; tests drive it.
    """

    def __init__(
        self,
        to_sample: int = 0,
        to_finish: int = 0,
        finishing: float | None = None,
        now: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._now = now
        self._sampling = _Work(to_sample, None)
        self._finishing = _Work(to_finish, finishing)
        self._start = self._last = now()

    def add(self, to_sample: int, to_finish: int) -> None:
        """Add frames, as of another view layer."""
        self._sampling.left += to_sample
        self._finishing.left += to_finish

    def sampled(self) -> None:
        self._sampling.add(self._lap())

    def finished(self) -> None:
        self._finishing.add(self._lap())

    def left(self) -> float | None:
        """Seconds until all is done; None where nothing is known yet."""
        works = [x for x in (self._sampling, self._finishing) if x.left]
        known = [(x.left, x.seconds) for x in works if x.seconds is not None]
        if len(known) < len(works):
            return None
        if not known:
            return 0.0
        # of what goes on now, which may be either
        present = sum(seconds for _, seconds in known) / len(known)
        spent = self._now() - self._last
        return sum(left * seconds for left, seconds in known) - min(spent, present)

    def fraction(self) -> float:
        """The part of all seconds that is spent; below 1 until nothing is left."""
        left, spent = self.left(), self._now() - self._start
        if left is None:
            return 0.0
        return min(spent / max(spent + left, 1e-6), _NEARLY)

    def _lap(self) -> float:
        now = self._now()
        spent, self._last = now - self._last, now
        return spent


def duration(seconds: float) -> str:
    """Seconds as a person reads them: 4.2 s, 45 s, 12 min, 3 h 24 min."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 100:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours < 100 else f"{hours} h"
