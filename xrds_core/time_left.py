"""How long each piece of long work took, and the rest will take."""

from __future__ import annotations

import time


class Clock:
    """Measures frames, or other pieces that take about equally long."""

    def __init__(self) -> None:
        self._done = 0
        self._start = self._last = time.perf_counter()

    def lap(self, left: int) -> str:
        """Say it of the piece that has just been finished; `left` are still to come."""
        now = time.perf_counter()
        took, self._last = now - self._last, now
        self._done += 1
        if not left:
            return f"{took:.1f} s"
        rest = _words((now - self._start) / self._done * left)
        return f"{took:.1f} s; {left} left, about {rest}"


def _words(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
