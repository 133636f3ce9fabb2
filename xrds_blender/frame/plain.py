"""Cycles alone, exactly as its own engine would render."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..cycles import session
from ..cycles.once import render_once
from ..cycles.pass_names import COMBINED
from .job import Picture, RenderJob
from .memory import peak_memory
from .progress import STAGES


def render_plain(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render into the engine's result and return the first view's picture.

    Raises Cancelled when the user stops it.
    """
    name = depsgraph.view_layer_eval.name
    clock = render_once(
        engine,
        depsgraph,
        samples=job.samples,
        seed=job.seed,
        denoiser=job.denoiser,
    )
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
