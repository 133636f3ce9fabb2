"""A frame with the samples of its neighbours, denoised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.sequence.finishing import finish_frame
from xrds_core.temporal.accumulate import Accumulated
from xrds_core.temporal.frame import Stored
from xrds_core.temporal.vectors import Movement

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
    finished = finish_frame(own, lenders, denoiser, movement, progress)
    gathered = finished.gathered
    return Picture(
        radiance=np.ascontiguousarray(finished.picture[..., :3]),
        alpha=np.ascontiguousarray(finished.picture[..., 3]),
        albedo=gathered.albedo,
        normal=gathered.normal,
        seconds=finished.seconds,
        plan=(
            *job.plan().decisions,
            accumulation(gathered),
            prefilter(finished.denoised),
        ),
        peak_memory=peak_memory(),
        device=denoiser.device,
        temporal=lent(job, gathered),
    )


def lent(job: RenderJob, gathered: Accumulated) -> Temporal:
    """What neighbours lent to a picture, as it tells."""
    samples = float(gathered.samples.mean())
    return Temporal(job.temporal_radius, gathered.frames, samples, gathered.rejected)


def accumulation(gathered: Accumulated) -> Decision:
    """What was decided where frames were asked for their samples."""
    frames = gathered.frames
    reason = "neighbouring frames show the same: their samples count here as well"
    return Decision("accumulation", f"frames {frames[0]} to {frames[-1]}", reason)
