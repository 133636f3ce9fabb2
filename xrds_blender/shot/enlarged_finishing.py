"""The picture of a frame above scale 1, with its neighbours' light and guides."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.temporal.accumulate import Accumulated, accumulate
from xrds_core.temporal.stand_in import stand_in
from xrds_core.temporal.takes import same_take
from xrds_core.temporal.vectors import Movement

from ..cycles.rendered import Beauty, Guides
from ..frame.enlarging import enlarge
from ..frame.job import NetworkFailed, Picture, RenderJob
from ..frame.memory import peak_memory
from .enlarged import View
from .finishing import accumulation, lent

if TYPE_CHECKING:
    from xrds_core import Upscaler
    from xrds_core.denoising import Denoiser


def finish_enlarged(
    own: View,
    lenders: Sequence[View],
    job: RenderJob,
    denoiser: Denoiser,
    upscaler: Upscaler,
    movement: Movement,
    report: Callable[[float], bool] | None = None,
) -> Picture:
    """The picture of a view.

    Its seconds are of accumulation, denoising and network alone. Raises Cancelled where
    `report` says so, and what the network raises.
    """
    started = time.perf_counter()
    gathered = accumulate(own.light, [each.light for each in lenders], movement)
    guides = _gathered_guides(own, lenders, movement)
    accumulated = time.perf_counter()
    beauty = _denoised(own, gathered, denoiser)
    denoised = time.perf_counter()
    try:
        picture = enlarge(
            beauty,
            guides,
            job,
            upscaler,
            exposure=own.exposure,
            skip_idle=own.plan.skip_idle,
            progress=report,
        )
    except NetworkFailed as error:
        error.number = own.light.number
        raise
    seconds = {
        "accumulate": accumulated - started,
        "denoise": denoised - accumulated,
        "network": time.perf_counter() - denoised,
    }
    return Picture(
        radiance=np.ascontiguousarray(picture[..., :3]),
        alpha=np.ascontiguousarray(picture[..., 3]),
        albedo=guides.albedo,
        normal=guides.normal,
        low_resolution=beauty.radiance,
        seconds=seconds,
        plan=(*own.plan.decisions, accumulation(gathered)),
        peak_memory=peak_memory(),
        device=str(upscaler.device),
        temporal=lent(job, gathered),
    )


def finish_alone(own: View, denoiser: Denoiser) -> Beauty:
    """The light of a view with its own samples alone, denoised."""
    return _denoised(own, accumulate(own.light, (), Movement()), denoiser)


def _denoised(own: View, gathered: Accumulated, denoiser: Denoiser) -> Beauty:
    assert gathered.radiance is not None
    picture = np.dstack((gathered.radiance, gathered.alpha))
    if not own.plan.denoise:
        return own.place.beauty(picture)
    denoised = denoiser(picture, gathered.albedo, gathered.normal)
    return own.place.beauty(denoised.radiance, gathered.radiance)


def _gathered_guides(own: View, lenders: Sequence[View], movement: Movement) -> Guides:
    """Guides with the samples of other frames; the richest of those of one name."""
    others = [each for each in lenders if each.guides is not None]
    if own.guide_name is not None:
        name = own.guide_name
        same = [own, *(each for each in others if name.is_same(each.guide_name))]
        own = max(same, key=_samples)
        others = [each for each in others if each not in same]
    lent = [each.guides for each in others if each.guides is not None]
    target = own.guides
    if target is None:
        number = own.light.number
        beside = sorted(lent, key=lambda each: abs(each.number - number))[:2]
        target = stand_in(number, own.camera, beside)
    found = accumulate(target, lent, movement)
    assert found.alpha is not None
    # their own number: where nothing is lent there are no more
    samples = max(1, int(target.samples))
    return Guides(found.albedo, found.normal, found.alpha, None, None, samples)


def lacks_guides(own: View, lenders: Sequence[View]) -> bool:
    """Whether a frame counted on guides of frames that a cut parts from it."""
    if own.guides is not None:
        return False
    rich = [each.light for each in lenders if each.guides is not None]
    return not same_take(own.light, rich)


def _samples(view: View) -> float:
    return 0.0 if view.guides is None else view.guides.samples
