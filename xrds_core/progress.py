"""How far a computation has come, for a callback that may cancel it."""

from __future__ import annotations

from collections.abc import Callable

from .errors import Cancelled

Callback = Callable[[float], object]
"""Takes a fraction in [0, 1] that never falls; False as its result cancels."""

_NEARLY = 0.999  # 1 is reported once, when all is done


class Progress:
    """Counts work and reports the fraction done; raises Cancelled."""

    def __init__(self, callback: Callback | None) -> None:
        self._callback = callback
        self._reported = 0.0
        self.begin(1.0)

    def begin(self, total: float) -> None:
        """Begin with work of `total`, or begin anew; what was reported stays."""
        self._total = total
        self._done = 0.0

    def add(self, work: float) -> None:
        self._done += work
        self.report(min(self._done / self._total, _NEARLY))

    def report(self, fraction: float) -> None:
        self._reported = max(self._reported, fraction)
        if self._callback is not None and self._callback(self._reported) is False:
            raise Cancelled
