"""Sizes of frames and borders in pixels, rounded as Blender rounds them."""

from __future__ import annotations

from typing import Any


def frame_size(render: Any) -> tuple[int, int]:
    """Width and height of the whole frame.

    Blender multiplies and divides integers (BKE_render_resolution): 720 rows at 70 %
    are 504, where 720 * 0.7 would be 503.
    """
    percentage = render.resolution_percentage
    return (
        render.resolution_x * percentage // 100,
        render.resolution_y * percentage // 100,
    )


def border_start(render: Any) -> tuple[int, int]:
    """Left column and bottom row of the border, counted from the lower left."""
    width, height = frame_size(render)
    return _pixel(render.border_min_x, width), _pixel(render.border_min_y, height)


def picture_size(render: Any) -> tuple[int, int]:
    """Width and height of what is rendered: of the border, where there is one."""
    width, height = frame_size(render)
    if not render.use_border:
        return width, height
    left, bottom = border_start(render)
    right = _pixel(render.border_max_x, width)
    return right - left, _pixel(render.border_max_y, height) - bottom


def _pixel(edge: float, side: int) -> int:
    """Blender multiplies in single precision, and cuts off."""
    import numpy as np

    return int(np.float32(edge) * np.float32(side))
