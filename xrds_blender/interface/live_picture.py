"""Draws the live picture into the image editor, in pixels of the frame from its corner.

The image editor draws scene-linear colours and gives them the scene's look by itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from xrds_core.arrays import Array

from ..cycles import live, session
from ..internals.lifetimes import PROCESS
from ..rendering import stages


@dataclass
class _Drawn:
    """A picture and its texture; made and freed while drawing, where Blender may."""

    picture: Any = None
    texture: Any = None


def draw(engine: Any, depsgraph: Any, space: Any) -> None:
    """Draw what `cycles.live` holds."""
    now = live.now()
    if now.picture is None:
        _draw_samples(engine, depsgraph, space, now.scale)
    else:
        _draw_picture(now, now.picture, _height(engine))


def _draw_samples(engine: Any, depsgraph: Any, space: Any, scale: int) -> None:
    """Cycles' own drawing, its pixels as large as the frame has them."""
    import gpu

    height = _height(engine)
    with gpu.matrix.push_pop():
        gpu.matrix.translate((0.0, float(height - -(-height // scale) * scale)))
        gpu.matrix.scale((float(scale), float(scale)))
        session.functions().draw(engine, depsgraph, space)


def _draw_picture(now: live.Live, picture: Array, height: int) -> None:
    import gpu
    from gpu_extras.presets import draw_texture_2d

    rows, columns = (side * now.scale for side in picture.shape[:2])
    dy, dx = now.offset
    gpu.state.blend_set("ALPHA_PREMULT")
    place = -dx, height + dy - rows
    draw_texture_2d(_texture(picture), place, columns, rows)
    gpu.state.blend_set("NONE")


def _texture(picture: Any) -> Any:
    import gpu
    import numpy as np

    drawn = PROCESS.of(_Drawn)
    if drawn.picture is not picture:
        rows = np.ascontiguousarray(picture[::-1], np.float32)  # the lowest one first
        height, width = rows.shape[:2]
        data = gpu.types.Buffer("FLOAT", rows.size, rows.ravel())
        texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
        drawn.picture, drawn.texture = picture, texture
    return drawn.texture


def _height(engine: Any) -> int:
    return engine.get_result().resolution_y


def forget() -> None:
    """Free the texture; on the main thread."""
    drawn = PROCESS.of(_Drawn)
    drawn.picture = drawn.texture = None


@bpy.app.handlers.persistent
def _forget_soon(*_: Any) -> None:
    live.clear()
    if not bpy.app.background:
        bpy.app.timers.register(forget)


def register() -> None:
    """Listen to the ends of renders."""
    for handlers in (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel):
        handlers.append(_forget_soon)


def unregister() -> None:
    """Listen no more."""
    for handlers in (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel):
        handlers.remove(_forget_soon)


def draw_status(self: Any, context: Any) -> None:
    """Draw the stage into the status bar, before Blender draws its progress bar."""
    stage = stages.current()
    if stage is not None:
        stages.show()
        self.layout.label(text=stage)
