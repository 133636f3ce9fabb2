"""Which frames are neighbours, in what order they are loaded, and what they cost.

A frame reuses samples of those up to `radius` frames before and after it, between two
shot cuts; at the ends there are fewer. Frames are processed in order: each is loaded
once, stays in memory while a later frame needs it, and is finished when its last
neighbour is loaded.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Generic, TypeVar

from .errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence


Loaded = TypeVar("Loaded")

# Per pixel: albedo and normal, in half floats, and inverse depth; then radiance and its
# noise, a Vector pass and an alpha, in half floats, and the inverse depth of images.
_BYTES = 2 * 3 * 2 + 4
_IMAGE_BYTES = 4
_LIGHT_BYTES, _VECTOR_BYTES, _ALPHA_BYTES = 12, 8, 2


@dataclass(frozen=True)
class Shot:
    """The frames of a shot in order of time, and its temporal radius.

    `frames` are the numbers of the frames to finish; `radius` counts in them, so that a
    shot rendered in steps has as many neighbours. `cuts` are the first frames after a
    cut: no frame has neighbours across it. `others` are neighbours only, such as frames
    that another machine finishes. Raises UsageError for a negative radius.
    """

    frames: tuple[int, ...]
    radius: int
    cuts: frozenset[int] = frozenset()
    others: tuple[int, ...] = ()
    order: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        if self.radius < 0:
            raise UsageError(f"temporal radius {self.radius}: give 0 or more frames")
        order = tuple(sorted({*self.frames, *self.others}))
        object.__setattr__(self, "order", order)

    def neighbours(self, frame: int) -> tuple[int, ...]:
        """Return the neighbour frames of `frame`, nearest first."""
        place = bisect_left(self.order, frame)
        around = self.order[max(0, place - self.radius) : place + self.radius + 1]
        part = self._part(frame)
        return tuple(
            sorted(
                (x for x in around if x != frame and self._part(x) == part),
                key=lambda x: (abs(x - frame), x),
            )
        )

    def is_between(self, frame: int) -> bool:
        """Whether its index is odd and both adjacent frames are its neighbours."""
        place = bisect_left(self.order, frame)
        beside = {*self.order[place - 1 : place], *self.order[place + 1 : place + 2]}
        found = {*self.neighbours(frame)}
        return place % 2 == 1 and len(beside) == 2 and beside <= found

    def _part(self, frame: int) -> int:
        """Return the number of cuts up to a frame."""
        return sum(cut <= frame for cut in self.cuts)


def place_of(frame: int, frames: Sequence[int]) -> int:
    """Return a frame's index in its shot, of which `frames` may be any part.

    Frames in even steps are counted from frame 0, so that parts of a shot rendered
    separately agree. Others are counted from the first one.
    """
    step = step_of(frames)
    return frame // step if step else sorted(set(frames)).index(frame)


def step_of(frames: Sequence[int]) -> int | None:
    """Return how far frames lie apart, 1 for a single one; None if not evenly."""
    steps = {after - before for before, after in pairwise(sorted(set(frames)))}
    return max(steps, default=1) if len(steps) < 2 else None


@dataclass(frozen=True)
class Neighbourhood(Generic[Loaded]):
    """A frame of a shot and the neighbour frames whose samples it reuses, by number."""

    number: int
    own: Loaded
    neighbours: dict[int, Loaded]


class Window(Generic[Loaded]):
    """The part of a shot that is in memory, a sliding window over its frames.

    `load` returns one frame and is called once for each, in order, and not before it is
    needed. None means that a frame is missing or damaged: it is left out, and is no
    neighbour of others. At most one frame and its neighbours are in memory.
    """

    def __init__(self, shot: Shot, load: Callable[[int], Loaded | None]) -> None:
        self.shot = shot
        self._load = load
        self._loaded: dict[int, Loaded | None] = {}

    @property
    def newest(self) -> int | None:
        """The last frame in memory."""
        return max(self._loaded, default=None)

    def missing(self, number: int) -> list[int]:
        """Return the frames to load for the neighbourhood of a frame, in order."""
        needed = (number, *self.shot.neighbours(number))
        return sorted(x for x in needed if x not in self._loaded)

    def neighbourhood(self, number: int) -> Neighbourhood[Loaded] | None:
        """Return a frame and its neighbours; None where the frame itself is missing."""
        numbers = self.shot.neighbours(number)
        first = min(number, *numbers, number)
        for old in [x for x in self._loaded if x < first]:
            del self._loaded[old]
        for new in self.missing(number):
            self.load(new)
        own = self._loaded[number]
        if own is None:
            return None
        found = {x: self._loaded[x] for x in numbers}
        neighbours = {x: frame for x, frame in found.items() if frame is not None}
        return Neighbourhood(number, own, neighbours)

    def load(self, number: int) -> None:
        """Load a frame ahead of its turn, unless it is in memory already."""
        if number not in self._loaded:
            self._loaded[number] = self._load(number)

    def get(self, number: int) -> Loaded | None:
        """Return a frame if it is in memory."""
        return self._loaded.get(number)

    def replace(self, number: int, frame: Loaded) -> None:
        """Store another frame in place of one in memory."""
        self._loaded[number] = frame

    def __iter__(self) -> Iterator[Neighbourhood[Loaded]]:
        """Yield the neighbourhood of each frame of the shot that exists, in order.

        Each is released when the next one is requested.
        """
        for number in sorted(set(self.shot.frames)):
            found = self.neighbourhood(number)
            if found is not None:
                yield found
            del found


def bytes_needed(
    width: int,
    height: int,
    frames: int,
    alpha: bool = False,
    vector: bool = False,
    light: bool = True,
    images: bool = False,
) -> int:
    """Return the bytes that `frames` frames of half floats take in a window.

    Guides alone have no `light`.
    """
    each = _BYTES + _LIGHT_BYTES * light
    each += _VECTOR_BYTES * vector + _ALPHA_BYTES * alpha + _IMAGE_BYTES * images
    return width * height * each * frames
