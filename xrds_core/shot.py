"""Which frames of a shot are neighbours.

A frame reuses samples of those up to `radius` frames before and after it, between two
shot cuts; at the ends there are fewer.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from .errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence


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
