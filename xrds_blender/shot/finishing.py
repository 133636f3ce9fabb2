"""A frame with the samples of its neighbours, denoised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.sequence.finishing import finish_frame
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
    finished = finish_frame(own, lenders, denoiser, movement, progress)
    gathered = finished.gathered
    temporal = Temporal(
        job.temporal_radius,
        finished.frames,
        float(gathered.samples.mean()),
        gathered.rejected,
    )
    decision = accumulation(finished.frames)
    return Picture(
        radiance=np.ascontiguousarray(finished.picture[..., :3]),
        alpha=np.ascontiguousarray(finished.picture[..., 3]),
        albedo=gathered.albedo,
        normal=gathered.normal,
        seconds=finished.seconds,
        plan=(*job.plan().decisions, decision, prefilter(finished.denoised)),
        peak_memory=peak_memory(),
        device=denoiser.device,
        temporal=temporal,
    )


def accumulation(frames: Sequence[int]) -> Decision:
    """What was decided where these frames were asked for their samples."""
    reason = "neighbouring frames show the same: their samples count here as well"
    return Decision("accumulation", f"frames {frames[0]} to {frames[-1]}", reason)
