"""Pictures made without rendering: known light on known surfaces.

Arrays are float32 (height, width, channels), scene-linear. `side` is in output
pixels; low-resolution pictures are the exact area means of the full ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from xrds_core.arrays import Array

FACING = (0.0, 0.0, 1.0)  # a normal that looks at the camera


class Inputs(NamedTuple):
    """The inputs of an enlargement."""

    radiance: Array
    """(h, w, 3)"""
    albedo: Array
    """(H, W, 3), as the normal."""
    normal: Array

    def with_radiance(self, radiance: Array) -> Inputs:
        """Return the same guides under other light."""
        return self._replace(radiance=np.asarray(radiance, np.float32))


def area_mean(x: Array, scale: int) -> Array:
    """Return the means of scale x scale blocks."""
    height, width = x.shape[0] // scale, x.shape[1] // scale
    blocks = x.reshape(height, scale, width, scale, -1)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64), np.float32)


def constant(height: int, width: int, value: float | tuple[float, ...]) -> Array:
    """Return one colour or vector everywhere, (height, width, 3)."""
    return np.broadcast_to(np.float32(value), (height, width, 3)).copy()


def blocks(height: int, width: int, seed: int = 0) -> Array:
    """Return random blocks of 1, 5 and 16 pixels in [0, 1]: texture and noise."""
    random = np.random.default_rng(seed)
    total = np.zeros((height, width, 3), np.float32)
    for k in (1, 5, 16):
        coarse = random.random((-(-height // k), -(-width // k), 3), np.float32)
        total += coarse.repeat(k, 0).repeat(k, 1)[:height, :width] / 3
    return total


def waves(height: int, width: int, seed: int = 0) -> Array:
    """Return smooth light around 1, between 0.3 and 1.7."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] / np.reshape((height, width), (2, 1, 1))
    total = np.ones((height, width, 3))
    for channel in range(3):
        for _ in range(3):
            rows, columns = random.uniform(0.3, 1.5, 2)
            phase = 2 * np.pi * (rows * y + columns * x) + random.uniform(0, 6)
            total[..., channel] += 0.7 / 3 * np.sin(phase)
    return total.astype(np.float32)


def dome(height: int, width: int, bumps: int = 2) -> Array:
    """Return unit normals of round bumps over the picture."""
    y, x = np.mgrid[0:height, 0:width] / np.reshape((height, width), (2, 1, 1))
    slopes = 0.9 * np.sin(2 * np.pi * bumps * np.stack((x, -y), axis=-1))
    normal = np.concatenate((slopes, np.ones((height, width, 1))), axis=-1)
    unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return unit.astype(np.float32)


def textured(side: int, scale: int, seed: int = 0, width: int | None = None) -> Inputs:
    """Return light over two decades under guides that know nothing of it."""
    height, width = side, width or side
    low = height // scale, width // scale
    return Inputs(
        0.01 + 10.0 * blocks(*low, seed) ** 4,
        blocks(height, width, seed + 1),
        2.0 * blocks(height, width, seed + 2) - 1.0,
    )


def lit_surface(side: int, scale: int) -> tuple[Inputs, Array]:
    """Return inputs and the true picture: a lamp's light on a painted, bumpy wall."""
    albedo = 0.1 + 0.8 * blocks(side, side)
    normal = dome(side, side)
    light = waves(side, side) * (0.2 + normal[..., :1] ** 2 + normal[..., 2:])
    truth = (albedo * light).astype(np.float32)
    return Inputs(area_mean(truth, scale), albedo, normal), truth


def even(side: int, scale: int, value: float, albedo: float) -> Inputs:
    """Return constant light on a constant wall."""
    return Inputs(
        constant(side // scale, side // scale, value),
        constant(side, side, albedo),
        constant(side, side, FACING),
    )
