"""The places of things that move by themselves, by the best that the frames tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .rigid import by_matrices
from .vectors import Trails

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .frame import Stored
    from .motion import Detour


class Movement:
    """Finds what moved between frames of one shot.

    One object serves a whole shot: what it finds of a frame is kept while that frame
    is. Frames with an index are asked for matrices, others for their Vector passes;
    where there are neither, nothing is taken to move but the camera.
    """

    def __init__(self) -> None:
        self._trails = Trails()

    def detours(self, here: Stored, others: Sequence[Stored]) -> list[Detour | None]:
        """Return for each of `others` the places of what moved by itself."""
        followed = self._trails.detours(here, others)
        return [
            by_matrices(here, there) if _indexed(here, there) else followed.get(i)
            for i, there in enumerate(others)
        ]


def _indexed(here: Stored, there: Stored) -> bool:
    return here.index is not None and there.index is not None
