"""One view layer of one frame, inside `RenderEngine.render()`."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from ..cycles.passes import CyclesPasses
from . import history, progress, torch_folder
from .full_size import render_full_size
from .job import Picture, RenderJob
from .networks import load_upscaler
from .picking import pick, picked_decisions
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
    if job.is_picked:
        return _render_picked(engine, depsgraph, job, start)
    place = history.place_of(depsgraph)
    try:
        if job.plain:
            picture = render_plain(engine, depsgraph, job)
        elif job.scale == 1:
            picture = render_full_size(engine, depsgraph, job)
        else:
            if torch_folder.loaded() is None:  # which takes some seconds
                progress.begin(engine, progress.LOADING, 0)
            # first: missing weights are to cost no render
            upscaler = load_upscaler(job)
            picture = render_enlarged(engine, depsgraph, job, upscaler)
    finally:
        progress.end()
    picture.seconds["total"] = time.perf_counter() - start
    history.keep(place, job, picture)
    return picture


def _render_picked(
    engine: Any, depsgraph: Any, job: RenderJob, start: float
) -> Picture:
    """Probe the scene, choose what a time budget or a quality asks for, render it."""
    place = history.place_of(depsgraph)
    with CyclesPasses(engine, depsgraph) as passes:
        picked, decision = pick(passes, job, start)
        engine.report({"INFO"}, f"XRDS: {decision.value}: {decision.reason}")
        picture = render_layer(engine, depsgraph, picked)
    seconds = picture.seconds | {"total": time.perf_counter() - start}
    decisions = picked_decisions(picked, decision, picture.plan)
    picture = replace(picture, seconds=seconds, plan=decisions, job=picked)
    history.keep(place, picked, picture)
    return picture
