"""Which neighbours of a frame may lend to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..temporal.frame import Stored
    from .reading import FrameFile


class Lenders:
    """Leaves out neighbours of another size, with other passes, or of another render.

    `say` takes a line about each frame that does not fit its neighbours, once.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._odd: set[int] = set()

    def of(
        self, number: int, own: FrameFile, beside: Mapping[int, FrameFile]
    ) -> list[Stored]:
        """Return the neighbours that lend to frame `number`, in their order."""
        if not own.lends:
            return []
        return [
            other.stored
            for n, other in beside.items()
            if other.lends and self._fits(number, own, n, other)
        ]

    def _fits(self, number: int, own: FrameFile, n: int, other: FrameFile) -> bool:
        why = _difference(own, other)
        if why and not {number, n} & self._odd:
            self._odd.add(n)
            self._say(f"frames {number} and {n} lend nothing to each other: {why}")
        return not why


def _difference(one: FrameFile, two: FrameFile) -> str:
    """Say in what frames differ so that they cannot lend; "" if in nothing."""
    if one.stored.shape != two.stored.shape:
        old, new = (f"{w}x{h}" for h, w in (one.stored.shape, two.stored.shape))
        return f"their sizes are {old} and {new} pixels"
    if one.stored.picture.shape[1] != two.stored.picture.shape[1]:
        return "one has alpha, the other has not"
    if one.key != two.key:
        return "they were rendered from other files or with other settings"
    return ""
