"""Cycles alone, exactly as its own engine would render."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..cycles import session
from ..cycles.borrowed import Borrowed
from ..cycles.pass_names import COMBINED
from ..cycles.settings import set_denoising, set_sampling
from .job import Picture, RenderJob
from .memory import peak_memory
from .progress import STAGES


def render_plain(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render into the engine's result and return the first view's picture.

    Raises Cancelled when the user stops it.
    """
    name = depsgraph.view_layer_eval.name
    clock = _run(engine, depsgraph, job)
    session.stop_if_cancelled(engine)
    result = engine.get_result()
    layer, size = result.layers[name], (result.resolution_x, result.resolution_y)
    view = next((view.name for view in result.views), "")
    pixels = session.read_pass(layer, COMBINED, view, size)
    assert pixels is not None
    seconds = dict.fromkeys(STAGES, 0.0)
    return Picture(
        radiance=np.ascontiguousarray(pixels[..., :3]),
        alpha=np.ascontiguousarray(pixels[..., 3]),
        seconds=seconds | {"sync": clock.sync, "beauty": clock.render},
        plan=job.plan().decisions,
        peak_memory=peak_memory(),
    )


def _run(engine: Any, depsgraph: Any, job: RenderJob) -> session.StageClock:
    keeps_session = engine.path_resolve("render").use_persistent_data
    with Borrowed() as borrowed:
        set_sampling(borrowed, depsgraph.scene_eval, job.samples, job.seed)
        if job.denoiser is not None and session.has_denoiser():
            scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
            set_denoising(borrowed, scene, layer, True, job.denoiser)
        try:
            return session.run(engine, depsgraph)
        finally:
            if not keeps_session:
                borrowed.forget()  # Cycles frees the evaluated scene as it syncs
                session.free(engine)
