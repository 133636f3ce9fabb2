"""A painted ball around the origin, as panoramas see it: all frames are known."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xrds_core.accumulation.camera import Camera, Sphere
from xrds_core.accumulation.frame import Frame

Array = NDArray[np.float64]
WIDTH, HEIGHT, RADIUS = 96, 48, 4.0


def camera(
    x: float = 0.0,
    z: float = 0.0,
    yaw: float = 0.0,
    sphere: Sphere | None = None,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    window: tuple[int, int] = (0, 0),
) -> Camera:
    """A panorama at (x, 0, z), turned to the left by ``yaw``."""
    world = np.eye(4)
    world[:3, :3] = [[cos(yaw), 0, sin(yaw)], [0, 1, 0], [-sin(yaw), 0, cos(yaw)]]
    world[:3, 3] = x, 0.0, z
    view, none = np.linalg.inv(world), np.zeros((4, 4))
    return Camera(view, none, size, window, sphere=sphere or Sphere())


def rays(eye: Camera, shape: tuple[int, int] = (HEIGHT, WIDTH)) -> Array:
    """Return the world directions (H, W, 3) of the pixels' centres."""
    assert eye.sphere is not None
    left, right = eye.sphere.longitude
    low, high = eye.sphere.latitude
    column = np.arange(shape[1]) + 0.5 + eye.window[0]
    row = np.arange(shape[0]) + 0.5 + eye.window[1]
    longitude = left + column / eye.size[0] * (right - left)
    latitude = high - row[:, None] / eye.size[1] * (high - low)
    level = np.cos(latitude)
    parts = level * np.sin(longitude), np.sin(latitude), -level * np.cos(longitude)
    own = np.stack(np.broadcast_arrays(*parts), -1)
    return own @ np.linalg.inv(eye.view)[:3, :3].T


def frame(
    number: int,
    eye: Camera,
    noise: float = 0.0,
    shape: tuple[int, int] = (HEIGHT, WIDTH),
    **more: Any,
) -> Frame:
    """What is seen from inside the ball."""
    start, ray = np.linalg.inv(eye.view)[:3, 3], rays(eye, shape)
    along = ray @ start
    depth = -along + np.sqrt(along**2 - start @ start + RADIUS**2)
    point = start + depth[..., None] * ray
    colour = 0.5 + 0.3 * np.sin(point * [1.0, 1.3, 0.7])
    away = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    normal = -point / RADIUS @ eye.view[:3, :3].T @ away.T
    rng = np.random.default_rng(number + 1000)
    noisy = colour * (1 + noise * rng.standard_normal((*shape, 1)))
    return Frame(
        number=number,
        camera=eye,
        radiance=noisy.astype(np.float32),
        albedo=colour.astype(np.float32),
        normal=normal.astype(np.float32),
        depth=depth.astype(np.float32),
        **more,
    )
