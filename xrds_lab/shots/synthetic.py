"""Frames of a shot without a renderer, of any size: to time what finishes them."""

from __future__ import annotations

import numpy as np

from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame, Halves
from xrds_core.arrays import Array

SAMPLES = 2.0
_FOCUS = 2.0  # clip units
_STEP = 0.011  # units by which the camera moves in a frame
_WALL, _COLUMN = 10.0, 5.0  # distances of what there is
_NOISE = 0.3  # standard deviation of a half, of its light


def frame(number: int, width: int, height: int) -> Frame:
    """A frame (height, width) of a textured wall behind textured columns.

    The camera trucks. Samples are in two halves and each pixel has its motion, as in
    frames that Cycles renders.
    """
    shift = number * _STEP
    depth, place = _hits(width, height, shift)
    colour = _texture(place, depth)
    halves = _halves(number, colour)
    normal = np.zeros((height, width, 3), np.float32)
    normal[..., 2] = -1.0
    per_frame = _FOCUS * width / 2 * _STEP / depth
    zero = np.zeros_like(per_frame)
    return Frame(
        number=number,
        camera=_camera(width, height, shift),
        radiance=halves.radiance.mean(axis=0),
        albedo=colour,
        normal=normal,
        depth=depth,
        samples=SAMPLES,
        vector=np.stack([per_frame, zero, per_frame, zero], axis=-1),
        halves=halves,
    )


def _camera(width: int, height: int, x: float) -> Camera:
    view = np.eye(4)
    view[0, 3] = -x
    project = np.diag([_FOCUS, _FOCUS * width / height, -1.0, 0.0])
    project[2, 3], project[3, 2] = -0.2, -1.0
    return Camera(view, project, (width, height))


def _hits(width: int, height: int, shift: float) -> tuple[Array, Array]:
    """Depth (H, W) and where in the world a pixel's ray ends, x and y (H, W, 2)."""
    across = ((np.arange(width) + 0.5) / width * 2 - 1) / _FOCUS
    up = (1 - (np.arange(height) + 0.5) / height * 2) * height / width / _FOCUS
    column = np.abs(np.mod(across * _COLUMN + shift, 1.5) - 0.75) < 0.2
    depth = np.where(column, _COLUMN, _WALL)[None].repeat(height, 0)
    place = np.stack([across * depth + shift, up[:, None] * depth], axis=-1)
    return depth.astype(np.float32), place.astype(np.float32)


def _texture(place: Array, depth: Array) -> Array:
    waves = np.sin(place[..., :1] * [4.0, 6.2, 3.4] + place[..., 1:] * [2.6, 4.4, 5.8])
    near = 0.2 * (depth < _WALL)[..., None]
    return np.asarray(0.45 + 0.25 * waves + near, np.float32)


def _halves(number: int, colour: Array) -> Halves:
    dice = np.random.default_rng(number + 1000)
    both = np.stack([colour, colour])
    noise = dice.standard_normal((*both.shape[:-1], 1), np.float32)
    return Halves(both * (1 + np.float32(_NOISE) * noise))
