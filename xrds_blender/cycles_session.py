"""Cycles run by hand on an engine object of our own, one session for several passes.

Cycles writes into the render result of the engine that its session was made with.
The session lives as long as the passes do: `reset` makes it take the new size and
settings, and it keeps what did not change (compiled kernels, images, most meshes).
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


def run(engine: Any, depsgraph: Any) -> StageClock:
    """Render the current settings with the engine's session, made when missing."""
    import bpy

    cycles = functions()
    with StageClock() as clock:
        if getattr(engine, "session", None) and not any(depsgraph.updates):
            # Without updates Cycles skips its sync and would keep film and samples.
            cycles.free(engine)
        if not getattr(engine, "session", None):
            cycles.create(engine, bpy.data)
        cycles.reset(engine, bpy.data, depsgraph)
        cycles.render(engine, depsgraph)
        # With tiles the pixels lie in a file until this call.
        cycles.render_frame_finish(engine)
    return clock


def free(engine: Any) -> None:
    """End the engine's session if it has one."""
    if getattr(engine, "session", None):
        functions().free(engine)
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
