"""The frames of a sequence, read one by one, and which neighbours they reuse."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from ..accumulation.equal_noise import IndependentFrames
from ..errors import NotReusable, PictureError, Unfit
from ..frames import frame_path, in_words
from .depth_kind import DepthKind
from .frame_file import read_frame

if TYPE_CHECKING:
    from ..accumulation.accumulate import Accumulated
    from ..accumulation.frame import Stored
    from .frame_file import FrameFile
    from .made_of import Recipe, State


class Loader:
    """Reads the frames of a sequence.

    A frame that is damaged or lacks passes is left out, and the others go on without
    it. But what the first two lack is assumed to be missing in all: that is raised.

    Parameters
    ----------
    pattern : str
        Path of the files, with # for the digits of the frame number.
    recipe : Recipe
        The files of each frame, and how they are read.
    reusable : bool
        False for frames that need no camera and no depth.
    say : callable
        Takes one line of text about a frame.

    Attributes
    ----------
    failed : dict of int to str
        Why frames were not read, by number.
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

    def look(self, numbers: Sequence[int], existing: Container[int]) -> None:
        """Report frames without a file, in one line.

        Parameters
        ----------
        numbers : sequence of int
            The frames.
        existing : container of int
            Those with a file.
        """
        missing = [n for n in numbers if n not in existing]
        paths = {n: frame_path(self._pattern, n) for n in missing}
        self.failed |= {n: f"no file {path}" for n, path in paths.items()}
        self._ahead |= dict.fromkeys(missing)
        if missing:
            first, which = paths[missing[0]], in_words(missing)
            self._say(f"left out for lack of a file, such as {first}: frames {which}")

    def first(self, numbers: Iterable[int]) -> FrameFile | None:
        """Load the first frame that can be read.

        Parameters
        ----------
        numbers : iterable of int
            Frame numbers.

        Returns
        -------
        frame : FrameFile or None
            None if no frame can be read.

        Raises
        ------
        Unfit
            If the first two are unfit, or the only one is.
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


class NeighbourSelection:
    """Leaves out neighbours whose samples cannot be reused.

    Those have another size, other passes, the same noise, or come from another render.

    Parameters
    ----------
    say : callable
        Takes one line of text about each frame that does not fit its neighbours, and
        about depths of another kind.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._odd: set[int] = set()
        self._independent = IndependentFrames(say)
        self._depth = DepthKind(say)
        self._had_neighbours = self._reused = False

    def select(
        self, number: int, own: FrameFile, beside: Mapping[int, FrameFile]
    ) -> list[Stored]:
        """Select the neighbours whose samples a frame reuses.

        Parameters
        ----------
        number : int
            Frame number.
        own : FrameFile
            The frame.
        beside : mapping of int to FrameFile
            Its neighbours.

        Returns
        -------
        neighbours : list of Stored
            In the order of `beside`.
        """
        if not own.reusable:
            return []
        fitting = [
            other.stored
            for n, other in beside.items()
            if other.reusable and self._fits(number, own, n, other)
        ]
        if not own.key:  # others' files
            self._depth.look(own.stored, fitting)
        return self._independent.of(own.stored, fitting)

    def record(self, others: Sequence[Stored], accumulated: Accumulated) -> None:
        """Note whether any samples are reused in this shot."""
        self._had_neighbours |= bool(others)
        self._reused |= len(accumulated.frames) > 1 and accumulated.rejected < 1.0

    def report(self) -> None:
        """Report a shot in which no samples were reused: its cameras may be wrong."""
        if self._had_neighbours and not self._reused:
            self._say(
                "no frame reused samples of another: by their cameras and depths they "
                "show different places; check these if it is one shot"
            )

    def _fits(self, number: int, own: FrameFile, n: int, other: FrameFile) -> bool:
        why = _find_difference(own, other)
        if why and not {number, n} & self._odd:
            self._odd.add(n)
            self._say(f"frames {number} and {n} share no samples: {why}")
        return not why


def _find_difference(own: FrameFile, other: FrameFile) -> str:
    """Return why two frames cannot share samples; "" if they can."""
    if own.stored.shape != other.stored.shape:
        old, new = (f"{w}x{h}" for h, w in (own.stored.shape, other.stored.shape))
        return f"their sizes are {old} and {new} pixels"
    if own.stored.picture.shape[1] != other.stored.picture.shape[1]:
        return "one has alpha, the other has not"
    if own.stored.parts.keys() != other.stored.parts.keys():
        return "they hold different parts of the light"
    if own.key != other.key:
        return "they were rendered from other files or with other settings"
    if own.subset is not None and own.subset == other.subset:
        return (
            "they have the same noise, of frames in other steps; render both with the "
            "frames of the whole shot"
        )
    return ""
