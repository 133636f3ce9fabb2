"""Enlargements without a network: what any weights must beat.

The demodulated base is in front_end, because the networks stand on it.
Arrays are float32 (height, width, 3), scene-linear; the low-resolution picture is the
area mean of the full-resolution one, guides are full-resolution.
"""

from __future__ import annotations

import torch
from torch.nn import functional

from xrds_core.arrays import Array
from xrds_core.errors import PictureError
from xrds_core.superres.front_end import to_picture, to_planes

# Chosen on the very windows that are measured, which favours this rival alone.
SPATIAL_SIGMA = 0.5  # of a low-resolution pixel
ALBEDO_SIGMA = 0.1
NORMAL_SIGMA = 0.15
RADIUS = 2


def bicubic(radiance: Array, scale: int) -> Array:
    """Enlarge (h, w, 3) to (scale h, scale w, 3) by cubic convolution (Keys 1981).

    The overshoot below zero is cut off.
    """
    planes = to_planes(radiance)
    # antialias takes Keys' own a = -0.5; without it a = -0.75, which bends ramps
    large = functional.interpolate(
        planes, scale_factor=scale, mode="bicubic", align_corners=False, antialias=True
    )
    return to_picture(large.clamp_min(0))


def joint_bilateral(
    radiance: Array, albedo: Array, normal: Array, scale: int, radius: int = RADIUS
) -> Array:
    """Joint bilateral upsampling (Kopf et al. 2007) of (h, w, 3) under the guides.

    Every full-resolution pixel is a mean of the (2 radius + 1)^2 low-resolution pixels
    around it, weighted by a Gaussian of their distance and by how much their
    area-averaged albedo and normal resemble the pixel's own.
    Raises PictureError when the guides are not scale times the radiance.
    """
    height, width = radiance.shape[:2]
    if not albedo.shape == normal.shape == (scale * height, scale * width, 3):
        raise PictureError(
            f"guides of shapes {albedo.shape} and {normal.shape} do not fit a "
            f"{width}x{height} picture at scale {scale}"
        )
    low, guide = to_planes(radiance), _guide_planes(albedo, normal)
    low_guide = functional.avg_pool2d(guide, scale)
    around = torch.cat([low, low_guide], dim=1)
    around = functional.pad(around, (radius,) * 4, mode="replicate")
    total = torch.zeros(1, 3, scale * height, scale * width)
    weights = torch.zeros(1, 1, scale * height, scale * width)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            y, x = radius + dy, radius + dx
            near = _nearest(around[..., y : y + height, x : x + width], scale)
            unlike = (near[:, 3:] - guide).square_().sum(dim=1, keepdim=True)
            distance = _squared_distance(height, width, scale, dy, dx)
            # float32 keeps exp above zero for every exponent clamped here
            weight = torch.exp(-0.5 * (unlike + distance).clamp_max(150))
            total += weight * near[:, :3]
            weights += weight
    return to_picture(total / weights)


def _guide_planes(albedo: Array, normal: Array) -> torch.Tensor:
    """Both guides as (1, 6, H, W), in units of their sigmas."""
    return torch.cat(
        [to_planes(albedo) / ALBEDO_SIGMA, to_planes(normal) / NORMAL_SIGMA], dim=1
    )


def _squared_distance(
    height: int, width: int, scale: int, dy: int, dx: int
) -> torch.Tensor:
    """From each pixel to its low-res neighbour at (dy, dx), in spatial sigmas."""
    fraction = (torch.arange(scale) + 0.5) / scale - 0.5  # of a low-res pixel
    rows = ((dy - fraction) / SPATIAL_SIGMA).square().repeat(height)
    columns = ((dx - fraction) / SPATIAL_SIGMA).square().repeat(width)
    return rows[:, None] + columns


def _nearest(x: torch.Tensor, scale: int) -> torch.Tensor:
    return functional.interpolate(x, scale_factor=scale, mode="nearest")
