"""Ctrl-C and SIGTERM as a wish to stop soon, so that no step is left half done."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType
from typing import Any

from tqdm import tqdm

TOLD = (
    "stopping after this step, from where the same command goes on; "
    "once more to stop at once"
)
SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """While entered, the first signal sets `wished`; a second one acts as before."""

    def __init__(self) -> None:
        self.wished = False
        self._before: dict[int, Any] = {}
        self._wake = -1

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            self._wake = signal.set_wakeup_fd(-1)
            self._before = {s: signal.signal(s, self._wish) for s in SIGNALS}
        return self

    def __exit__(self, *error: object) -> None:
        self._restore()

    def _wish(self, number: int, frame: FrameType | None) -> None:
        self.wished = True
        self._restore()
        tqdm.write(TOLD, file=sys.stderr)

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._before:
            signal.set_wakeup_fd(self._wake)
        self._before = {}
