"""A frame with the samples of its neighbours, denoised."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.temporal.accumulate import accumulate
from xrds_core.temporal.frame import Stored
from xrds_core.temporal.moving import Movement

from ..frame.full_size import prefilter
from ..frame.job import Picture, RenderJob, Temporal
from ..frame.memory import peak_memory
from ..planning.plan import Decision

if TYPE_CHECKING:
    from xrds_core.denoising import Denoiser


def finish(
    own: Stored,
    lenders: Sequence[Stored],
    job: RenderJob,
    denoiser: Denoiser,
    movement: Movement,
    progress: Callable[[float], bool] | None = None,
) -> Picture:
    """The picture of a frame; its seconds are of accumulation and denoising alone.

    Raises Cancelled where `progress` says so.
    """
    started = time.perf_counter()
    gathered = accumulate(own, lenders, movement)
    accumulated = time.perf_counter()
    noisy = np.dstack((gathered.radiance, gathered.alpha))
    denoised = denoiser(noisy, gathered.albedo, gathered.normal, progress=progress)
    seconds = {
        "accumulate": accumulated - started,
        "denoise": time.perf_counter() - accumulated,
    }
    frames = tuple(sorted((own.number, *(each.number for each in lenders))))
    temporal = Temporal(
        job.temporal_radius, frames, float(gathered.samples.mean()), gathered.rejected
    )
    return Picture(
        radiance=np.ascontiguousarray(denoised.radiance[..., :3]),
        alpha=np.ascontiguousarray(denoised.radiance[..., 3]),
        albedo=gathered.albedo,
        normal=gathered.normal,
        seconds=seconds,
        plan=(*job.plan().decisions, _decision(frames), prefilter(denoised)),
        peak_memory=peak_memory(),
        device=denoiser.device,
        temporal=temporal,
    )


def _decision(frames: Sequence[int]) -> Decision:
    reason = "neighbouring frames show the same: their samples count here as well"
    return Decision("accumulation", f"frames {frames[0]} to {frames[-1]}", reason)
