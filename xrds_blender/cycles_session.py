"""Cycles run by hand on an engine object of our own, one session for several passes.

Cycles writes into the render result of the engine that its session was made with.
One session serves every pass: `reset` makes it take the new size and settings, and
only what the dependency graph calls updated is synced again. The graph still calls
everything updated when a render starts, so `prepare` lets it forget that; the second
sync and its BVH then cost next to nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .clock import StageClock

Array = NDArray[np.float32]


def functions() -> Any:
    """The functions module of the Cycles add-on that comes with Blender."""
    import addon_utils

    if not addon_utils.check("cycles")[1]:
        addon_utils.enable("cycles", default_set=False)
    from cycles import engine

    return engine


def has_denoiser() -> bool:
    """Whether this build of Blender holds OpenImageDenoise."""
    import _cycles

    return bool(_cycles.with_openimagedenoise)


def prepare(engine: Any, depsgraph: Any) -> None:
    """Hand the graph's updates to a session kept from the frame before, then forget.

    To be called before anything is set on evaluated data: should the graph hold
    changes not yet evaluated, those are made now.
    """
    import bpy

    if getattr(engine, "session", None):
        functions().reset(engine, bpy.data, depsgraph)
    handlers = bpy.app.handlers
    # Nothing changed, so nobody is to hear of it.
    held = [
        (listeners, list(listeners))
        for listeners in (handlers.depsgraph_update_pre, handlers.depsgraph_update_post)
    ]
    try:
        for listeners, _ in held:
            listeners.clear()
        depsgraph.update()
    finally:
        for listeners, before in held:
            listeners[:] = before


def run(engine: Any, depsgraph: Any) -> StageClock:
    """Render the current settings with the engine's session, made when missing."""
    import bpy

    cycles = functions()
    with StageClock() as clock:
        if getattr(engine, "session", None) and not _tagged(depsgraph):
            # Without an update Cycles would keep the film and samples of before.
            free(engine)
        if not getattr(engine, "session", None):
            cycles.create(engine, bpy.data)
        cycles.reset(engine, bpy.data, depsgraph)
        cycles.render(engine, depsgraph)
        # With tiles the pixels lie in a file until this call.
        cycles.render_frame_finish(engine)
    return clock


def _tagged(depsgraph: Any) -> bool:
    """Tag the evaluated scene as updated; False if this Blender does not do so."""
    settings = depsgraph.scene_eval.cycles
    settings.seed = settings.seed  # setting is what tags, whatever the value
    return any(True for _ in depsgraph.updates)


def free(engine: Any) -> None:
    """End the engine's session if it has one."""
    if getattr(engine, "session", None):
        functions().free(engine)  # takes the attribute away
    engine.session = None


def read_pass(layer: Any, name: str, view: str, size: tuple[int, int]) -> Array | None:
    """Pixels (height, width, channels), row 0 on top; None if there is no such pass.

    `size` is the width and height of the whole render result.
    """
    found = layer.passes.find_by_name(name, view)
    if found is None:
        return None
    width, height = size
    pixels = np.empty(width * height * found.channels, np.float32)
    found.rect.foreach_get(pixels)
    return pixels.reshape(height, width, found.channels)[::-1]


def write_pass(layer: Any, name: str, view: str, pixels: Array) -> None:
    """Replace the pixels (height, width, channels), row 0 on top, of a whole pass."""
    found = layer.passes.find_by_name(name, view)
    if found is not None:
        flipped = np.ascontiguousarray(pixels[::-1], dtype=np.float32)
        found.rect.foreach_set(flipped.ravel())
