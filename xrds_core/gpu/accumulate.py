"""Accumulation on a card: the steps of `temporal.accumulate` by kernels.

Shot cuts, object motion, coarse rejection and the search for images are the
processor's: they look at few pixels. What every pixel of every neighbour needs is the
card's. The processor's result is the reference.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..notices import warn
from ..temporal.accumulate import Means
from ..temporal.similarity import MARGIN
from .band import SUMS_BESIDE, Band
from .card import CardLost
from .frames import FramesOnCard
from .target import Target

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..arrays import Array
    from ..temporal.accumulate import Aligned, Reprojected
    from ..temporal.candidates import Images
    from ..temporal.frame import Stored
    from .card import Card

_BAND = 2_400_000  # pixels that are accumulated at once: a frame of full HD


class CardAccumulator:
    """Accumulates frames with light on a card; keeps them there between calls."""

    def __init__(self, card: Card) -> None:
        self.card = card
        self.is_lost = False
        self._frames = FramesOnCard(card)

    @property
    def name(self) -> str:
        """The card's."""
        return self.card.name

    def takes(self, target: Stored, others: Sequence[Stored]) -> bool:
        """Whether it can accumulate these: neither guides alone nor panoramas."""
        flat = target.has_light and target.camera.sphere is None
        return flat and bool(others) and not self.is_lost

    def means(
        self,
        target: Stored,
        groups: Sequence[Sequence[Aligned | Reprojected]],
        images: Images | None,
        usual: float,
        lit: Sequence[str] = (),
    ) -> Means | None:
        """Return the means of a frame, its neighbours, and its parts that are lit.

        None where the card fails, which is said once: the processor goes on.
        """
        try:
            return self._means(target, groups, images, usual, lit)
        except CardLost as error:
            self.is_lost = True
            self._frames.clear()
            warn(f"{error}; the processor accumulates instead")
            return None

    def _means(
        self,
        target: Stored,
        groups: Sequence[Sequence[Aligned | Reprojected]],
        images: Images | None,
        usual: float,
        lit: Sequence[str],
    ) -> Means:
        here = Target(self._frames, target, images, usual)
        height, width = target.shape
        rows = self._rows(width, target.picture.shape[1])
        parts = []
        for first in range(0, height, rows):
            band = Band(here, first, min(first + rows, height))
            parts.append(band.means(groups, lit))
        planes = zip(*(part.passes + part.parts for part in parts), strict=True)
        found = [_joined(each).reshape(height, width, -1) for each in planes]
        count = len(parts[0].passes)
        return Means(
            found[:count],
            found[count:],
            _joined([part.samples for part in parts]).reshape(height, width),
            sum(part.reused for part in parts),
        )

    def _rows(self, width: int, channels: int) -> int:
        """How many rows fit, an even number: light is compared by tiles of two."""
        largest = self.card.largest_buffer // (2 * 4 * (channels + SUMS_BESIDE))
        rows = min(_BAND, largest) // width - 2 * (MARGIN + 1)
        return max(rows, 2) // 2 * 2


def _joined(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
