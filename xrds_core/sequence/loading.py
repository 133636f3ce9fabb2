"""The frames of a sequence, read one by one; what cannot be read is told once."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterable, Sequence
from typing import TYPE_CHECKING

from ..errors import PictureError
from ..frames import frame_path, in_words
from .file_errors import NotLending, Unfit
from .reading import read_frame

if TYPE_CHECKING:
    from .reading import FrameFile, Reading


class Loader:
    """Reads frames; `failed` are the reasons of those that cannot be, by number.

    A frame that is damaged or lacks passes is left out, and the others go on without
    it. But what the first two lack will be lacking in all: that is raised.
    """

    def __init__(
        self, pattern: str, reading: Reading, lends: bool, say: Callable[[str], object]
    ) -> None:
        self.failed: dict[int, str] = {}
        self._pattern, self._reading = pattern, reading
        self._lends, self._say = lends, say
        self._ahead: dict[int, FrameFile | None] = {}
        self._any_is_fit = False
        self._seconds = 0.0

    def look(self, numbers: Sequence[int], there: Container[int]) -> None:
        """Tell of frames that have no file, all in one line; `there` are the others."""
        missing = [n for n in numbers if n not in there]
        paths = {n: frame_path(self._pattern, n) for n in missing}
        self.failed |= {n: f"no file {path}" for n, path in paths.items()}
        self._ahead |= dict.fromkeys(missing)
        if missing:
            first, which = paths[missing[0]], in_words(missing)
            self._say(f"left out for want of a file, as {first}: frames {which}")

    def first(self, numbers: Iterable[int]) -> FrameFile | None:
        """Return the first of some frames that can be read; None if none can.

        Raises Unfit where the first two are, or the only one.
        """
        unfit: Unfit | None = None
        for number in numbers:
            try:
                frame = self.load(number)
            except Unfit as error:
                if unfit is not None:
                    raise unfit from error
                unfit = error
                continue
            self._ahead[number] = frame
            if frame is not None:
                return frame
        if unfit is not None:
            raise unfit
        return None

    def load(self, number: int) -> FrameFile | None:
        """Return a frame; None, with a line about it, where it cannot be read."""
        if number in self._ahead:
            return self._ahead.pop(number)
        started = time.perf_counter()
        try:
            return self._read(number)
        except PictureError as error:
            if isinstance(error, Unfit) and not self._any_is_fit:
                raise
            self.leave_out(number, error)
            return None
        finally:
            self._seconds += time.perf_counter() - started

    def leave_out(self, number: int, error: PictureError) -> None:
        """Tell of a frame that cannot be finished."""
        self.failed[number] = str(error)
        self._say(f"frame {number} is left out: {error}")

    def seconds(self) -> float:
        """Return the seconds that reading took since this was asked last."""
        seconds, self._seconds = self._seconds, 0.0
        return seconds

    def _read(self, number: int) -> FrameFile:
        path = frame_path(self._pattern, number)
        try:
            frame = read_frame(path, number, self._reading, lends=self._lends)
        except NotLending as error:
            if not self._any_is_fit:
                raise
            self._say(f"frame {number} is denoised by itself: {error.reason}")
            return read_frame(path, number, self._reading, lends=False)
        self._any_is_fit = True
        return frame
