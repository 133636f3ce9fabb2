"""Which neighbours of a frame may lend to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..temporal.accumulate import Accumulated
    from ..temporal.frame import Stored
    from .reading import FrameFile


class Lenders:
    """Leaves out neighbours of another size, with other passes, or of another render.

    `say` takes a line about each frame that does not fit its neighbours, once.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._odd: set[int] = set()
        self._asked = self._lent = False

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

    def heed(self, others: Sequence[Stored], gathered: Accumulated) -> None:
        """Notice whether anything is ever lent in this shot."""
        self._asked |= bool(others)
        self._lent |= len(gathered.frames) > 1 and gathered.rejected < 1.0

    def sum_up(self) -> None:
        """Tell of a shot in which nothing was lent: its cameras may be wrong."""
        if self._asked and not self._lent:
            self._say(
                "no frame took samples of another: what they show lies elsewhere by "
                "their cameras and depths; check these if it is one shot"
            )

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
