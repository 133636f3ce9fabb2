"""The one loop over the frames of a shot, wherever they come from.

Cycles inside Blender's animation render, Cycles from outside of it, cached samples and
EXR files are each a `FrameSource`. To add another, derive from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from .overlap import Overlap

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .shot import Shot

Loaded = TypeVar("Loaded")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Neighbourhood(Generic[Loaded]):
    """A frame of a shot and the neighbour frames whose samples it reuses, by number."""

    number: int
    own: Loaded
    neighbours: dict[int, Loaded]


class FrameSource(Generic[Loaded]):
    """Where the noisy samples of a shot's frames come from."""

    @property
    def prepares(self) -> bool:
        """Whether `prepare` takes long enough to be done beside a frame's loading."""
        return False

    def load(self, number: int) -> Loaded | None:
        """Return the samples of a frame.

        Parameters
        ----------
        number : int
            The frame. Each is loaded once, in order, and not before it is needed.

        Returns
        -------
        Loaded or None
            None where the frame is missing or damaged: it is left out, and is no
            neighbour of others.
        """
        raise NotImplementedError

    def is_done(self, frame: Neighbourhood[Loaded]) -> bool:
        """Whether a frame need not be finished, as another machine was quicker."""
        return False

    def prepare(self, frame: Neighbourhood[Loaded]) -> Any:
        """Return what `complete` takes of a frame, and which loads nothing.

        It may be called in another thread, while a later frame is loaded.
        """
        return None

    def complete(
        self, frame: Neighbourhood[Loaded], prepared: Any
    ) -> tuple[Loaded, Loaded]:
        """Return a frame with all that it is finished from, and what it lends.

        By default it is both times as it was loaded. `prepared` is what `prepare` has
        returned.
        """
        return frame.own, frame.own


class Window(Generic[Loaded]):
    """The part of a shot that is in memory, a sliding window over its frames.

    At most one frame and its neighbours are in memory; while one is prepared, as many
    more as are loaded meanwhile.
    """

    def __init__(self, shot: Shot, source: FrameSource[Loaded]) -> None:
        self.shot = shot
        self._source = source
        self._loaded: dict[int, Loaded | None] = {}
        self._prepared: dict[int, tuple[Neighbourhood[Loaded], Callable[[], Any]]] = {}

    @property
    def newest(self) -> int | None:
        """The last frame in memory."""
        return max(self._loaded, default=None)

    def missing(self, number: int) -> list[int]:
        """Return the frames to load for the neighbourhood of a frame, in order."""
        needed = (number, *self.shot.neighbours(number))
        return sorted(x for x in needed if x not in self._loaded)

    def load(self, number: int) -> None:
        """Load a frame ahead of its turn, unless it is in memory already."""
        if number not in self._loaded:
            self._loaded[number] = self._source.load(number)

    def get(self, number: int) -> Loaded | None:
        """Return a frame if it is in memory."""
        return self._loaded.get(number)

    def neighbourhood(self, number: int) -> Neighbourhood[Loaded] | None:
        """Return a frame, completed, and its neighbours; None where it is missing."""
        for old in [x for x in self._prepared if x < number]:  # asked for no more
            del self._prepared[old]
        if number not in self._prepared and not self._gather(number):
            return None
        return self._complete(number)

    def prepare(self, number: int, overlap: Overlap[Any]) -> None:
        """Prepare a frame beside what comes next, before it is asked for.

        The frames before it have been.
        """
        if self._gather(number):
            frame = self._collect(number)
            work = overlap.begin(partial(self._source.prepare, frame))
            self._prepared[number] = frame, work

    def __iter__(self) -> Iterator[Neighbourhood[Loaded]]:
        """Yield each frame of the shot that exists and is to be finished, in order.

        Each is released when the next one is requested.
        """
        for number in self._numbers():
            yield self._complete(number)

    def beside(self, overlap: Overlap[Any]) -> Iterator[Neighbourhood[Loaded]]:
        """Yield the same, each prepared beside the loading of the next one.

        So the next one is loaded before it is completed.
        """
        before: int | None = None
        for number in self._numbers():
            if before is not None:
                yield self._complete(before)
            self.prepare(number, overlap)
            before = number
        if before is not None:
            yield self._complete(before)

    def _numbers(self) -> Iterator[int]:
        """Yield the frames that exist and are to be finished, with all they need."""
        for number in sorted(set(self.shot.frames)):
            if self._gather(number) and not self._source.is_done(self._collect(number)):
                yield number

    def _gather(self, number: int) -> bool:
        """Load what is missing of a neighbourhood, and drop what no frame needs.

        Returns whether the frame is there.
        """
        first = min(number, *self.shot.neighbours(number), number)
        for old in [x for x in self._loaded if x < first]:
            del self._loaded[old]
        for new in self.missing(number):
            self.load(new)
        return self._loaded[number] is not None

    def _collect(self, number: int) -> Neighbourhood[Loaded]:
        """Return a frame that is there, and those of its neighbours that are."""
        own = self._loaded[number]
        assert own is not None
        loaded = {x: self._loaded[x] for x in self.shot.neighbours(number)}
        neighbours = {x: frame for x, frame in loaded.items() if frame is not None}
        return Neighbourhood(number, own, neighbours)

    def _complete(self, number: int) -> Neighbourhood[Loaded]:
        if number in self._prepared:
            frame, result = self._prepared.pop(number)
            prepared = result()
        else:
            frame = self._collect(number)
            prepared = self._source.prepare(frame)
        own, lent = self._source.complete(frame, prepared)
        if number in self._loaded:
            self._loaded[number] = lent
        return replace(frame, own=own)


def finish_frames(
    shot: Shot,
    source: FrameSource[Loaded],
    finish: Callable[[Neighbourhood[Loaded]], Result],
    *,
    beside: bool = False,
) -> Iterator[Result]:
    """Finish the frames of a shot in order, each when its last neighbour is loaded.

    Parameters
    ----------
    shot : Shot
        Which frames are finished, and which are their neighbours.
    source : FrameSource
        Where their samples come from.
    finish : callable
        Makes of a frame and its neighbours what is yielded.
    beside : bool
        Whether a frame is finished in a thread of its own while the source loads the
        next one; where the source `prepares` frames, that is done there as well.
    """
    window = Window(shot, source)
    with Overlap[Result](beside) as overlap:
        is_late = beside and source.prepares
        for frame in window.beside(overlap) if is_late else window:
            yield from overlap.put(partial(finish, frame))
            del frame
        yield from overlap.rest()
