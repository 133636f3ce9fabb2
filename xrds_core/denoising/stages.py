"""One progress made of those of several filters, which also cancels them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import Cancelled

if TYPE_CHECKING:
    from ..progress import Callback

_NEARLY = 0.999  # 1 is reported once, when all is done


class Stages:
    """Reports the fraction done of all stages to a callback; it never falls."""

    def __init__(self, callback: Callback | None) -> None:
        self._callback = callback
        self._reported = 0.0
        self._start = self._share = 0.0
        self._is_cancelled = False

    def begin(self, share: float) -> None:
        """Begin a stage that is `share` of all the work."""
        self._start, self._share = self._start + self._share, share

    def report(self, fraction: float) -> None:
        """Report the fraction of all the work; raises Cancelled."""
        self._reported = max(self._reported, fraction)
        if self._callback is not None and self._callback(self._reported) is False:
            self._is_cancelled = True
            raise Cancelled

    def monitor(self, fraction: float) -> bool:
        """Take a filter's fraction of its stage; False as the result stops it."""
        try:
            self.report(min(self._start + self._share * fraction, _NEARLY))
        except Cancelled:
            self._is_cancelled = True
        return not self._is_cancelled

    def check(self) -> None:
        """Raise Cancelled if a filter was stopped."""
        if self._is_cancelled:
            raise Cancelled
