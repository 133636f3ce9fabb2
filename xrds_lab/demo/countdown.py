"""A line on stderr that tells what is being done, and how long the rest will take."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType

_PERIOD = 1.0  # seconds between two looks at the clock
_CLEAR = "\r\x1b[K"  # back to the start of the line, and delete it


class Countdown:
    """Counts the seconds of work that was given so many of them.

    On a terminal the line is kept up to date while Cycles renders; elsewhere each task
    has a line of its own.
    """

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds
        self._task, self._stop = "", threading.Event()
        self._thread = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Countdown:
        if sys.stderr.isatty():
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()

    @property
    def left(self) -> float:
        """Seconds left; 0 once they are used up."""
        return max(0.0, self._end - time.monotonic())

    def needs(self, seconds: float) -> None:
        """Give the work so many seconds from now, where it has fewer left."""
        self._end = max(self._end, time.monotonic() + seconds)

    def say(self, task: str) -> None:
        """Tell what is being done from now on."""
        self._task = task
        if self._thread.is_alive():
            self._write()
        else:
            print(self._line(), file=sys.stderr, flush=True)

    def _tick(self) -> None:
        while not self._stop.wait(_PERIOD):
            self._write()

    def _write(self) -> None:
        sys.stderr.write(_CLEAR + self._line())
        sys.stderr.flush()

    def _line(self) -> str:
        minutes, seconds = divmod(round(self.left), 60)
        rest = f"{minutes}:{seconds:02} left" if self.left else "longer than foreseen"
        return f"demo: {rest}: {self._task}"
