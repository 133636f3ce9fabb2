"""The one loop over the frames of a shot, wherever they come from.

Cycles inside Blender's animation render, Cycles from outside of it, cached samples and
EXR files are each a `FrameSource`. To add another, derive from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Generic, TypeVar

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

    def complete(self, frame: Neighbourhood[Loaded]) -> tuple[Loaded, Loaded]:
        """Return a frame with all that it is finished from, and what it lends.

        By default it is both times as it was loaded.
        """
        return frame.own, frame.own


class Window(Generic[Loaded]):
    """The part of a shot that is in memory, a sliding window over its frames.

    At most one frame and its neighbours are in memory.
    """

    def __init__(self, shot: Shot, source: FrameSource[Loaded]) -> None:
        self.shot = shot
        self._source = source
        self._loaded: dict[int, Loaded | None] = {}

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
        frame = self._gather(number)
        return None if frame is None else self._complete(frame)

    def __iter__(self) -> Iterator[Neighbourhood[Loaded]]:
        """Yield each frame of the shot that exists and is to be finished, in order.

        Each is released when the next one is requested.
        """
        for number in sorted(set(self.shot.frames)):
            frame = self._gather(number)
            if frame is not None and not self._source.is_done(frame):
                yield self._complete(frame)
            del frame

    def _gather(self, number: int) -> Neighbourhood[Loaded] | None:
        """Load what is missing of a neighbourhood, and drop what no frame needs."""
        numbers = self.shot.neighbours(number)
        first = min(number, *numbers, number)
        for old in [x for x in self._loaded if x < first]:
            del self._loaded[old]
        for new in self.missing(number):
            self.load(new)
        own = self._loaded[number]
        if own is None:
            return None
        loaded = {x: self._loaded[x] for x in numbers}
        neighbours = {x: frame for x, frame in loaded.items() if frame is not None}
        return Neighbourhood(number, own, neighbours)

    def _complete(self, frame: Neighbourhood[Loaded]) -> Neighbourhood[Loaded]:
        own, self._loaded[frame.number] = self._source.complete(frame)
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
        next one.
    """
    with Overlap[Result](beside) as overlap:
        for frame in Window(shot, source):
            yield from overlap.put(partial(finish, frame))
            del frame
        yield from overlap.rest()
