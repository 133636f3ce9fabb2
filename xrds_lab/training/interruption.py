"""Ctrl-C and SIGTERM as a wish to stop soon, so that no step is left half done."""

from __future__ import annotations

import signal
import sys
import threading
import time
from types import FrameType
from typing import Any

from tqdm import tqdm

TOLD = (
    "stopping after this step, from where the same command goes on; "
    "once more to stop at once"
)
SAME_WISH = 1.0  # seconds: torchrun hands on what the terminal has sent already
SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """While entered, the first signal sets `wished`; a later one acts as before."""

    def __init__(self) -> None:
        self.wished = False
        self._when = 0.0
        self._before: dict[int, Any] = {}
        self._wake = -1

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            self._wake = signal.set_wakeup_fd(-1)
            self._before = {s: signal.signal(s, self._wish) for s in SIGNALS}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._before:
            signal.set_wakeup_fd(self._wake)
        self._before = {}

    def _wish(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if not self.wished:
            self.wished, self._when = True, now
            tqdm.write(TOLD, file=sys.stderr)
        elif now - self._when >= SAME_WISH:
            self.__exit__()
            signal.raise_signal(number)
