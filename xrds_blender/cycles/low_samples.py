"""A low-resolution render before anything is made of it: noisy, on Cycles' own grid."""

from __future__ import annotations

import time
from dataclasses import dataclass

from xrds_core.arrays import Array

from .low_camera import LowGrid, Region
from .rendered import Beauty, InProcess
from .samples import Samples


@dataclass(frozen=True)
class LowPlace:
    """Where the pixels of a low-resolution render lie, and what comes beside them.

    `window` are the pixels rendered, of `grid`; `offset` and `others` are as in
    `Beauty`. `seconds`: sync, beauty, denoise.
    """

    grid: LowGrid
    window: Region
    offset: tuple[int, int]
    others: dict[str, Array]
    seconds: dict[str, float]

    def beauty(self, picture: Array, noisy: Array | None = None) -> Beauty:
        """What the network takes, from radiance and alpha (h, w, 4) on the same grid.

        `noisy` (h, w, 3 or more) is the radiance before `picture` was denoised.
        """
        placed = self.grid.resample(picture, self.window)
        return Beauty(
            placed[..., :3].copy(),
            placed[..., 3].copy(),
            None if noisy is None else self.grid.resample(noisy, self.window)[..., :3],
            self.offset,
            self.seconds,
            self.others,
        )


@dataclass(frozen=True)
class LowSamples:
    """One view as Cycles sampled it, and where."""

    samples: Samples
    place: LowPlace

    def denoised(self, denoise: InProcess) -> Beauty:
        """Denoise before resampling: interpolated noise would count as texture."""
        started, given = time.perf_counter(), self.samples
        picture = denoise(given.picture, given.albedo, given.normal)
        self.place.seconds["denoise"] = time.perf_counter() - started
        return self.place.beauty(picture, given.picture)
