"""The frames of a sequence, read one by one; unreadable ones are reported once."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterable, Sequence
from typing import TYPE_CHECKING

from ..errors import NotReusable, PictureError, Unfit
from ..frames import frame_path, in_words
from .reading import read_frame

if TYPE_CHECKING:
    from .made_of import Recipe, State
    from .reading import FrameFile


class Loader:
    """Reads frames; `failed` holds the reasons for unreadable ones, by number.

    A frame that is damaged or lacks passes is left out, and the others go on without
    it. But what the first two lack is assumed to be missing in all: that is raised.
    """

    def __init__(
        self,
        pattern: str,
        recipe: Recipe,
        reusable: bool,
        say: Callable[[str], object],
    ) -> None:
        self.failed: dict[int, str] = {}
        self.states: dict[int, State] = {}
        """Of the files of each frame, as they were when it was read."""
        self._pattern, self._recipe = pattern, recipe
        self._reusable, self._say = reusable, say
        self._ahead: dict[int, FrameFile | None] = {}
        self._noisy_views: set[str] = set()
        self._any_is_fit = False
        self._seconds = 0.0

    def look(self, numbers: Sequence[int], there: Container[int]) -> None:
        """Report frames without a file, in one line; `there` are those with one."""
        missing = [n for n in numbers if n not in there]
        paths = {n: frame_path(self._pattern, n) for n in missing}
        self.failed |= {n: f"no file {path}" for n, path in paths.items()}
        self._ahead |= dict.fromkeys(missing)
        if missing:
            first, which = paths[missing[0]], in_words(missing)
            self._say(f"left out for lack of a file, such as {first}: frames {which}")

    def first(self, numbers: Iterable[int]) -> FrameFile | None:
        """Return the first frame of `numbers` that can be read; None if none can.

        Raises Unfit if the first two are unfit, or the only one is.
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
        """Return a frame; None, after reporting it, if it cannot be read."""
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
        """Record and report a frame that cannot be finished."""
        self.failed[number] = str(error)
        self._say(f"frame {number} is left out: {error}")

    def seconds(self) -> float:
        """Return the seconds that reading took since the last call."""
        seconds, self._seconds = self._seconds, 0.0
        return seconds

    def _read(self, number: int) -> FrameFile:
        self.states[number] = self._recipe.state(number)
        path, reading = frame_path(self._pattern, number), self._recipe.reading
        try:
            frame = read_frame(path, number, reading, reusable=self._reusable)
            self._any_is_fit = True
        except NotReusable as error:
            if not self._any_is_fit:
                raise
            self._say(f"frame {number} is denoised by itself: {error.reason}")
            frame = read_frame(path, number, reading, reusable=False)
        self.check(number)
        for view, why in frame.unread.items():
            if view not in self._noisy_views:
                self._noisy_views.add(view)
                self._say(f"the view {view} stays as noisy as it is: {why}")
        return frame

    def check(self, number: int) -> None:
        """Raise PictureError where a frame's files are others than those read."""
        if self.states[number] != self._recipe.state(number):
            path = frame_path(self._pattern, number)
            raise PictureError(
                f"{path} was replaced while it was in work; denoise with --resume"
            )
