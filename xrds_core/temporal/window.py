"""Which frames lend to which, in what order they are needed, and what they cost.

A frame takes samples from those up to `radius` frames before and after it, within
one cut of the shot; at the ends it takes what there is. Frames go by in order: each is
loaded once, kept while a frame to come needs it, and finished when its last neighbour
is there.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from ..errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Kept = TypeVar("Kept")

# Of albedo and normal, in half floats, and nearness; then of radiance and its noise, a
# Vector pass and an alpha, in half floats.
_BYTES = 2 * 3 * 2 + 4
_LIGHT_BYTES, _VECTOR_BYTES, _ALPHA_BYTES = 12, 8, 2


@dataclass(frozen=True)
class Shot:
    """The frames of a shot in order of time, and how far they lend to each other.

    `frames` are frame numbers, those that are to be finished; `radius` counts in
    them, so that a shot rendered in steps lends as far. `cuts` are the frames that
    begin something new: nothing is lent across. `lending` are frames that only lend,
    as those that another machine finishes. Raises UsageError for what cannot be.
    """

    frames: tuple[int, ...]
    radius: int
    cuts: frozenset[int] = frozenset()
    lending: tuple[int, ...] = ()
    order: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        if self.radius < 0:
            raise UsageError(f"temporal radius {self.radius}: give 0 or more frames")
        order = tuple(sorted({*self.frames, *self.lending}))
        object.__setattr__(self, "order", order)

    def lenders(self, frame: int) -> tuple[int, ...]:
        """Return the frames that lend to `frame`, the nearest ones first."""
        place = bisect_left(self.order, frame)
        around = self.order[max(0, place - self.radius) : place + self.radius + 1]
        take = self._take(frame)
        return tuple(
            sorted(
                (x for x in around if x != frame and self._take(x) == take),
                key=lambda x: (abs(x - frame), x),
            )
        )

    def is_between(self, frame: int) -> bool:
        """Return whether it lies between two lenders that themselves do not."""
        place = bisect_left(self.order, frame)
        beside = {*self.order[place - 1 : place], *self.order[place + 1 : place + 2]}
        return place % 2 == 1 and len(beside) == 2 and beside <= {*self.lenders(frame)}

    def _take(self, frame: int) -> int:
        """Return between which cuts a frame lies."""
        return sum(cut <= frame for cut in self.cuts)


def place_of(frame: int, frames: Sequence[int]) -> int:
    """Return a frame's place in its shot, of which `frames` may be any part.

    Frames in even steps are counted from frame 0, so that parts of a shot that are
    rendered apart agree. Others are counted from the first one.
    """
    order = sorted(set(frames))
    steps = {after - before for before, after in pairwise(order)}
    return frame // max(steps, default=1) if len(steps) < 2 else order.index(frame)


def slide(
    shot: Shot, load: Callable[[int], Kept | None]
) -> Iterator[tuple[int, Kept, dict[int, Kept]]]:
    """Yield (number, frame, lenders by number) for each frame of a shot, in order.

    `load` gives one frame and is called once for each, in order, and not before it is
    needed; None where a frame is missing or damaged: it lends nothing and is left out.
    At most a frame and its lenders are kept; what is yielded is dropped when the next
    one is asked for.
    """
    kept: dict[int, Kept | None] = {}
    for number in sorted(set(shot.frames)):
        lenders = shot.lenders(number)
        needed = sorted((number, *lenders))
        for old in [x for x in kept if x < needed[0]]:
            del kept[old]
        for new in needed:
            if new not in kept:
                kept[new] = load(new)
        frame = kept[number]
        if frame is not None:
            there = {x: kept[x] for x in lenders}
            yield number, frame, {x: y for x, y in there.items() if y is not None}


def bytes_needed(
    width: int,
    height: int,
    frames: int,
    alpha: bool = False,
    vector: bool = False,
    light: bool = True,
) -> int:
    """Return the bytes that `frames` frames of half floats take in a window.

    Guides alone have no `light`.
    """
    each = _BYTES + _LIGHT_BYTES * light
    each += _VECTOR_BYTES * vector + _ALPHA_BYTES * alpha
    return width * height * each * frames
