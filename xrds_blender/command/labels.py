"""Words in the lower corners of a picture, in Blender's own font."""

from __future__ import annotations

import numpy as np

from xrds_core.arrays import Array

_SIZE, _LEAST = 1 / 36, 9.0  # of letters over the picture's height; pixels at least
_ACROSS = 0.47  # of the picture's width that a label has at the most
_MARGIN = 0.6  # around it, in letters
_FINE = 4  # samples of each pixel's sides
_WHITE, _SHADE = 1.0, 0.15  # of the letters; of what is behind them


def draw_label(picture: Array, text: str, at_right: bool) -> None:
    """Draw a label into the lower left or right corner of a picture (H, W, 4)."""
    height, width = picture.shape[:2]
    triangles = _triangles(text)
    right, top = triangles.max(axis=(0, 1))
    low = triangles[..., 1].min()
    size = max(height * _SIZE, _LEAST)
    size = min(size, _ACROSS * width / (right + 2 * _MARGIN))
    margin = size * _MARGIN
    across, up = (round(size * x + 2 * margin) for x in (right, top - low))
    corner = np.array((margin, margin - low * size), np.float32)
    letters = _covered(triangles * size + corner, across, up)
    columns = slice(width - across, width) if at_right else slice(0, across)
    place = picture[max(height - up, 0) :, columns]
    letters = letters[-place.shape[0] :]
    place[..., :3] = place[..., :3] * _SHADE * (1 - letters) + _WHITE * letters
    place[..., 3] = 1.0


def _triangles(text: str) -> Array:
    """The letters as triangles (n, 3, 2), a line being one unit high."""
    import bpy

    curve = bpy.data.curves.new("XRDS", "FONT")
    item = bpy.data.objects.new("XRDS", curve)
    try:
        curve.body, curve.resolution_u = text, 3
        mesh = item.to_mesh()
        mesh.calc_loop_triangles()
        points = np.empty(len(mesh.vertices) * 3, np.float32)
        mesh.vertices.foreach_get("co", points)
        corners = np.empty(len(mesh.loop_triangles) * 3, np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        item.to_mesh_clear()
    finally:
        bpy.data.objects.remove(item)
        bpy.data.curves.remove(curve)
    return points.reshape(-1, 3)[corners.reshape(-1, 3), :2]


def _covered(triangles: Array, width: int, height: int) -> Array:
    """How much of each pixel (height, width, 1) triangles cover, the top row first."""
    fine = np.zeros((height * _FINE, width * _FINE), bool)
    for a, b, c in triangles * _FINE:
        first = np.maximum(np.floor(np.min((a, b, c), axis=0)), 0).astype(int)
        last = np.ceil(np.max((a, b, c), axis=0)).astype(int)
        y, x = np.mgrid[first[1] : last[1], first[0] : last[0]] + 0.5
        sides = [
            (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
            for p, q in ((a, b), (b, c), (c, a))
        ]
        inside = np.all([s >= 0 for s in sides], 0) | np.all([s <= 0 for s in sides], 0)
        part = fine[first[1] : last[1], first[0] : last[0]]
        part |= inside[: part.shape[0], : part.shape[1]]
    means = fine.reshape(height, _FINE, width, _FINE).mean(axis=(1, 3))
    return means[::-1, :, None].astype(np.float32)
