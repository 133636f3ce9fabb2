"""How crops are varied, so that few renders stand for many.

After OIDN's own training (github.com/RenderKit/oidn, training/dataset.py, 2026):
colours permuted, pictures flipped and transposed, light left out. OIDN permutes the
channels of normals; here they turn with the picture, as vectors do, and now and then at
random.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from xrds_core.arrays import Array

from .crop import Crop


def shade(
    albedo: Array, scale: int, exposure: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """Radiance of `albedo` under a smooth, coloured light: low-resolution and full."""
    stops = random.normal(0, 1, (1, 1, 4, 4)) + random.normal(0, 0.2, (1, 3, 1, 1))
    light = torch.nn.functional.interpolate(
        torch.from_numpy(np.exp2(stops)), size=albedo.shape[:2], mode="bicubic"
    )
    smooth = light[0].permute(1, 2, 0).clamp(min=0.05).numpy() / (4 * exposure)
    reference = (albedo * smooth).astype(np.float32)
    h, w = (n // scale for n in albedo.shape[:2])
    low = reference.reshape(h, scale, w, scale, 3).mean(axis=(1, 3))
    return low, reference


def over_denoised(low: Array, random: np.random.Generator) -> Array:
    """A random part of the texture smoothed away.

    A denoiser at low resolution takes fine texture for noise; the guides still hold it.
    """
    share = random.random()
    padded = np.pad(low, ((2, 2), (2, 2), (0, 0)), "edge")
    h, w = low.shape[:2]
    boxes = (padded[y : y + h, x : x + w] for y in range(5) for x in range(5))
    smooth = np.mean(list(boxes), axis=0)
    return ((1 - share) * low + share * smooth).astype(np.float32)


def permute_colours(crop: Crop, random: np.random.Generator) -> Crop:
    """The same permutation of the channels of radiance and albedo."""
    order = random.permutation(3)
    return crop.with_colours(lambda x: x[..., order])


def transpose_and_flip(crop: Crop, random: np.random.Generator) -> Crop:
    """One of the eight symmetries of the square; normals turn with the picture.

    Normals are in camera space, x to the right and y up, rows run downwards: so a
    transposed picture has x' = -y, y' = -x.
    """
    transposed, flip_y, flip_x = random.integers(2, size=3)
    turn = np.eye(3, dtype=np.float32)
    if transposed:
        crop = crop.with_pictures(lambda x: x.swapaxes(0, 1))
        turn = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, 1]], np.float32)
    if flip_y:
        crop = crop.with_pictures(lambda x: x[::-1])
        turn = turn * np.array([1, -1, 1], np.float32)
    if flip_x:
        crop = crop.with_pictures(lambda x: x[:, ::-1])
        turn = turn * np.array([-1, 1, 1], np.float32)
    return replace(crop, normal=crop.normal @ turn)


def tint(crop: Crop, stops: float, random: np.random.Generator) -> Crop:
    """Colour surfaces: a factor per channel, at most 1, on radiance and albedo.

    Of one bounce of light; longer paths would be tinted more than once.
    """
    factor = np.exp2(random.normal(0, stops, 3)).astype(np.float32)
    factor /= factor.max()
    return crop.with_colours(lambda x: x * factor)


def random_rotation(random: np.random.Generator) -> Array:
    """A rotation drawn uniformly: (3, 3)."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q.astype(np.float32)
