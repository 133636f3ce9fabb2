"""How long work took, and what is left of it will take."""

from __future__ import annotations

import time


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
