"""A frame with the samples of its neighbours, denoised."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..temporal.accumulate import Accumulated, accumulate
from ..temporal.neighbours import box

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..arrays import Array
    from ..denoising import Denoised, Denoiser
    from ..temporal.frame import Stored
    from ..temporal.vectors import Movement


# Samples lent for each of the frame's own, from which on the shot's picture counts in
# full, and how many must be lent in all: few samples tell little of what is right. The
# mean of 3x3 pixels decides: that single pixels have few is what denoisers are good at.
_ENOUGH, _IN_ALL = 1.0, 3.0
_SMOOTH = 3  # pixels across


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
    """Accumulate the samples of `lenders` onto a frame and denoise it.

    Where little is lent the picture is that of the frame alone, denoised as well:
    beside pixels of many samples a denoiser takes the noise of a few for detail.
    `region`, rows and columns, is what is denoised: black around a crop would tell the
    denoiser a wrong exposure. Raises Cancelled where `progress` says so.
    """
    started = time.perf_counter()
    gathered = accumulate(own, lenders, movement)
    alone = accumulate(own, []) if lenders else gathered
    share = _share(gathered, alone, own.samples)
    accumulated = time.perf_counter()
    region = region or (slice(None), slice(None))
    share = share[region]
    parts = 1 if _is_even(share) else 2
    denoised = denoiser(*_passes(gathered, region), progress=_part(progress, 0, parts))
    if parts == 2:
        passes = _passes(_filled(alone, gathered), region)
        single = denoiser(*passes, progress=_part(progress, 1, parts)).radiance
        mixed = single + (denoised.radiance - single) * share[..., None]
        denoised = replace(denoised, radiance=mixed)
    seconds = {
        "accumulate": accumulated - started,
        "denoise": time.perf_counter() - accumulated,
    }
    return Finished(denoised, gathered, seconds)


def _share(gathered: Accumulated, alone: Accumulated, samples: float) -> Array:
    """Return (H, W) in [0, 1]: how much the shot's picture counts, by what is lent.

    The frame has so many `samples` on the mean.
    """
    enough = max(_ENOUGH, _IN_ALL / samples)
    with np.errstate(divide="ignore", invalid="ignore"):  # where the frame has none
        lent = gathered.samples / alone.samples - np.float32(1.0)
    lent = np.where(alone.samples > 0.0, np.clip(lent / enough, 0.0, 1.0), 1.0)
    return np.clip(box(lent.astype(np.float32), _SMOOTH), 0.0, 1.0)


def _is_even(share: Array) -> bool:
    """Whether one picture is all that is asked for."""
    return bool((share == share.flat[0]).all()) and float(share.flat[0]) in (0.0, 1.0)


def _filled(alone: Accumulated, gathered: Accumulated) -> Accumulated:
    """Return the frame alone with what is lent to pixels that have no samples."""
    holes = alone.samples == 0.0
    if not holes.any():
        return alone

    def fill(one: Array | None, two: Array | None) -> Array | None:
        if one is None or two is None:
            return None
        return np.where(holes if one.ndim == 2 else holes[..., None], two, one)

    albedo = fill(alone.albedo, gathered.albedo)
    normal = fill(alone.normal, gathered.normal)
    assert albedo is not None
    assert normal is not None
    radiance = fill(alone.radiance, gathered.radiance)
    alpha = fill(alone.alpha, gathered.alpha)
    return replace(alone, radiance=radiance, albedo=albedo, normal=normal, alpha=alpha)


def _passes(frame: Accumulated, region: tuple[slice, slice]) -> list[Array]:
    """Return radiance, with alpha where there is one, albedo and normal of a region."""
    assert frame.radiance is not None
    noisy = frame.radiance
    if frame.alpha is not None:
        noisy = np.dstack((noisy, frame.alpha))
    passes = (noisy, frame.albedo, frame.normal)
    return [np.ascontiguousarray(each[region]) for each in passes]


def _part(
    progress: Callable[[float], bool] | None, number: int, parts: int
) -> Callable[[float], bool] | None:
    """Return what tells the progress of one of equal parts as that of the whole."""
    if progress is None or parts == 1:
        return progress
    return lambda done: progress((number + done) / parts)
