"""Half buffers: two halves of a frame's samples, rendered apart.

The mean of a frame is off the truth by noise that the frame alone cannot distinguish
from texture. Two halves of its samples can: what they have in common is the picture,
what they differ in is noise, pixel by pixel. (Rousselle et al. 2012 call them dual
buffers.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..arrays import Array

_TINY = np.float32(1e-9)


@dataclass(frozen=True)
class Halves:
    """The two half buffers of a frame; float32, the first axis is the half.

    `radiance`, `albedo`, `normal` (2, H, W, 3) and `alpha` (2, H, W), or None, are as
    in `Frame`, which holds the means of both. The halves are two subsets of one sample
    sequence, or have two seeds. `shares` are their shares of the samples; `counts`
    (2, H, W) their samples in each pixel, where they differ.
    """

    radiance: Array
    albedo: Array
    normal: Array
    alpha: Array | None = None
    shares: tuple[float, float] = (0.5, 0.5)
    counts: Array | None = None

    def share(self) -> Array:
        """Return the first half's share of the samples: (H, W), or one number."""
        if self.counts is None:
            return np.asarray(self.shares[0], np.float32)
        one, two = self.counts
        return np.where(one > 0.0, one / np.maximum(one + two, _TINY), 0.0)

    def mean(self, name: str) -> Array | None:
        """Return the mean of both halves of a pass by its name."""
        halves = getattr(self, name)
        if halves is None:
            return None
        share = self.share()
        if halves.ndim == 4:
            share = share[..., None]
        return np.asarray(halves[0] * share + halves[1] * (np.float32(1.0) - share))
