"""Selects the neighbour frames whose samples a frame may reuse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from ..temporal.equal_noise import IndependentFrames
from .depth_kind import DepthKind

if TYPE_CHECKING:
    from ..temporal.accumulate import Accumulated
    from ..temporal.frame import Stored
    from .reading import FrameFile


class NeighbourSelection:
    """Leaves out neighbours of another size, with other passes, or of another render.

    And those that have the same noise. `say` takes a line about each frame that does
    not fit its neighbours, once, and about depths of another kind.
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
        """Return the neighbours whose samples frame `number` reuses, in their order."""
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
        why = _difference(own, other)
        if why and not {number, n} & self._odd:
            self._odd.add(n)
            self._say(f"frames {number} and {n} share no samples: {why}")
        return not why


def _difference(one: FrameFile, two: FrameFile) -> str:
    """Return why two frames cannot share samples; "" if they can."""
    if one.stored.shape != two.stored.shape:
        old, new = (f"{w}x{h}" for h, w in (one.stored.shape, two.stored.shape))
        return f"their sizes are {old} and {new} pixels"
    if one.stored.picture.shape[1] != two.stored.picture.shape[1]:
        return "one has alpha, the other has not"
    if one.stored.parts.keys() != two.stored.parts.keys():
        return "they hold different parts of the light"
    if one.key != two.key:
        return "they were rendered from other files or with other settings"
    if one.subset is not None and one.subset == two.subset:
        return (
            "they have the same noise, of frames in other steps; render both with the "
            "frames of the whole shot"
        )
    return ""
