"""How many samples a file with a noise threshold asks for, learnt from one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xrds_core.accumulation.accumulate import sample_counts
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.local_filters import block_means
from xrds_core.arrays import Array
from xrds_core.pace.error import root_noise

from ...cycles.settings import LOOKS_EVERY

# Fewer samples than this, on the mean, are taken evenly: both halves of a frame under a
# threshold have at least one step, and two to differ in. So where a file takes 48, its
# halves would take 64.
_FEW = 4 * LOOKS_EVERY


@dataclass(frozen=True)
class Threshold:
    """What the file's noise threshold asks for, as one of its frames has shown.

    `samples` on the mean; a pixel takes `noise` times the variance of one sample of it,
    within the `least` and the `most` that any has taken.
    """

    samples: float
    least: float
    most: float
    noise: float

    def is_few(self, share: float) -> bool:
        """Whether such a share of the samples is sooner taken evenly."""
        return share * self.samples < _FEW

    def density(self, frame: Stored) -> Array:
        """Samples that the file takes in each block of a frame, over the mean."""
        asked = np.clip(self.noise * _noise(frame), self.least, self.most)
        return block_means(asked) / self.samples


def learn_threshold(frame: Stored, asked: Array) -> Threshold:
    """Learn from a frame what its file asks for.

    `asked` (H, W) are the samples that each pixel takes in the file, 0 where that is
    not known.
    """
    known = asked > 0.0
    counts, noise = asked[known], _noise(frame)[known]
    least, most, mean = (float(f(counts)) for f in (np.min, np.max, np.mean))
    low, high = 0.0, most / max(float(noise.mean()), 1e-12)
    for _ in range(40):  # by bisection: as many on the mean
        middle = (low + high) / 2
        if np.clip(middle * noise, least, most).mean() < mean:
            low = middle
        else:
            high = middle
    return Threshold(mean, least, most, low)


def _noise(frame: Stored) -> Array:
    """Variance (H, W) of one sample."""
    return root_noise(frame) * sample_counts(frame).reshape(frame.shape)
