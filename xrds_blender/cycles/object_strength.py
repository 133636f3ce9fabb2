"""How much neighbour frames count at each pixel, by the object that it shows.

Cycles' Object Index pass tells the object. An index of the file may be that of several
objects, and materials may read it; the pass is also of the first sample alone, which a
frame that continues a sequence does not take. So it has a render of its own: one sample
without bounces, in which an object's index is its strength.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from xrds_core.arrays import Array

from ..internals import spare_passes
from ..internals.borrowed import Borrowed
from ..scene.strength import shows_indices
from . import session
from .layer_session import LayerSession
from .samples import render_once

_LEVELS = 1000  # of strength; objects of equal strength share an index


def sample_strengths(
    engine: Any, depsgraph: Any, seed: int
) -> tuple[dict[str, Array], session.StageClock]:
    """Render how much neighbours count at each pixel (H, W), by view.

    The result then holds other passes than the frame's own. Raises Cancelled when the
    user stops it.
    """
    import bpy

    name = "Object Index" if bpy.app.version >= (5,) else "IndexOB"
    layer_name = depsgraph.view_layer_eval.name
    # what is synced for this render is of use to the next one, but for these
    render = depsgraph.scene_eval.render
    is_apart = render.use_motion_blur or render.use_persistent_data
    is_apart = is_apart or shows_indices(depsgraph)
    with LayerSession(engine, depsgraph) as layer, Borrowed() as borrowed:
        layer.hold_still()
        spare_passes.add(engine, layer_name, name, "X")
        # Cycles syncs no index of an instance again
        session.free(engine)
        _set_indices(borrowed, depsgraph.ids)
        borrowed.set(depsgraph.scene_eval.cycles, max_bounces=0)
        try:
            clock = render_once(engine, depsgraph, samples=1, seed=seed, noisy=True)
        finally:
            if is_apart:
                session.free(engine)
        passes = layer.all_passes()
    indices = {view: passes[view, name][..., 0] for view in layer.views}
    return {view: _strengths(index) for view, index in indices.items()}, clock


def _set_indices(borrowed: Borrowed, items: Sequence[Any]) -> None:
    """Give each object the index of its strength, 0 for 1."""
    import bpy

    for item in items:
        if isinstance(item, bpy.types.Object):
            strength = item.xrds_strength
            # for NaN, too, which a script may set
            weakness = 1.0 - strength if strength < 1.0 else 0.0
            borrowed.set(item, pass_index=round(weakness * _LEVELS))


def _strengths(index: Array) -> Array:
    return np.float32(1.0) - index / np.float32(_LEVELS)
