"""One view layer of one frame, inside `RenderEngine.render()`."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..cycles.passes import CyclesPasses
from . import history, progress, torch_folder
from .full_size import render_full_size
from .job import Picture, RenderJob
from .networks import load_upscaler
from .picking import pick, picked_decisions, report_pick
from .plain import render_plain
from .super_resolution import render_enlarged


def render_layer(
    engine: Any, depsgraph: Any, job: RenderJob, start: float | None = None
) -> Picture:
    """Render the layer into the engine's result; the picture is of its first view.

    `start`, a reading of perf_counter, is where a time budget and the total begin.
    Raises Cancelled when the user stops it and XRDSError where it cannot be done, then
    with nothing written; but NetworkFailed, as for too little memory, with the
    low-resolution picture in the result, enlarged.
    """
    start = time.perf_counter() if start is None else start
    place = history.place_of(depsgraph)
    if job.is_picked:
        picture = _render_picked(engine, depsgraph, job, start)
    else:
        picture = _render_job(engine, depsgraph, job)
    picture.seconds["total"] = time.perf_counter() - start
    history.keep(place, picture.job or job, picture)
    return picture


def _render_picked(
    engine: Any, depsgraph: Any, job: RenderJob, start: float
) -> Picture:
    """Probe the scene, choose what a time budget or a quality asks for, render it."""
    with CyclesPasses(engine, depsgraph) as passes:
        picked = pick(passes, job, start)
        report_pick(engine, picked)
        picture = _render_job(engine, depsgraph, picked.job, picked.denoise_in_time)
    decisions = picked_decisions(picked, picture.plan)
    return replace(picture, plan=decisions, job=picture.job or picked.job)


def _render_job(
    engine: Any,
    depsgraph: Any,
    job: RenderJob,
    denoise_in_time: Callable[[], str] | None = None,
) -> Picture:
    try:
        if job.plain:
            return render_plain(engine, depsgraph, job)
        if job.scale == 1:
            return render_full_size(engine, depsgraph, job, denoise_in_time)
        if torch_folder.loaded() is None:  # which takes some seconds
            progress.begin(engine, progress.LOADING, 0)
        # first: missing weights are to cost no render
        upscaler = load_upscaler(job)
        return render_enlarged(engine, depsgraph, job, upscaler)
    finally:
        progress.end()
