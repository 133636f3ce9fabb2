"""A frame with the samples of its neighbours, denoised."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..temporal.accumulate import Accumulated, accumulate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..arrays import Array
    from ..denoising import Denoised, Denoiser
    from ..temporal.frame import Stored
    from ..temporal.moving import Movement


@dataclass(frozen=True)
class Finished:
    """A finished frame.

    `denoised` holds its picture (H, W, 3), or (H, W, 4) with the alpha of `gathered`,
    or the region of it that was asked for; `seconds`: accumulate, denoise.
    """

    denoised: Denoised
    gathered: Accumulated
    seconds: dict[str, float]

    @property
    def picture(self) -> Array:
        """Radiance and alpha, where there is one: (H, W, 3) or (H, W, 4)."""
        return self.denoised.radiance


def finish_frame(
    own: Stored,
    lenders: Sequence[Stored],
    denoiser: Denoiser,
    movement: Movement,
    progress: Callable[[float], bool] | None = None,
    *,
    region: tuple[slice, slice] | None = None,
) -> Finished:
    """Accumulate the samples of `lenders` onto a frame and denoise it once.

    `region`, rows and columns, is what is denoised: black around a crop would tell the
    denoiser a wrong exposure. Raises Cancelled where `progress` says so.
    """
    started = time.perf_counter()
    gathered = accumulate(own, lenders, movement)
    accumulated = time.perf_counter()
    assert gathered.radiance is not None
    noisy = gathered.radiance
    if gathered.alpha is not None:
        noisy = np.dstack((noisy, gathered.alpha))
    passes = [noisy, gathered.albedo, gathered.normal]
    if region is not None:
        passes = [np.ascontiguousarray(each[region]) for each in passes]
    denoised = denoiser(*passes, progress=progress)
    seconds = {
        "accumulate": accumulated - started,
        "denoise": time.perf_counter() - accumulated,
    }
    return Finished(denoised, gathered, seconds)
