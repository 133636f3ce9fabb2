"""Alpha at full resolution, and radiance that fits it.

Radiance is premultiplied. Arrays are float32: low-resolution ones (h, w, ...), full
ones (H, W, ...) with H <= scale h, W <= scale w.
"""

from __future__ import annotations

import numpy as np
from torch.nn import functional

from ..arrays import Array
from .front_end import to_picture, to_planes, upsample_alpha, upsample_bilinear

_BAND = 64  # low-resolution rows at a time bound the memory of what is in between


def finish(picture: Array, low: Array, guide_alpha: Array | None, scale: int) -> None:
    """Fill in the alpha of a picture and free its radiance of fringes, in place.

    Parameters
    ----------
    picture : (H, W, 4) float32 array
        The enlarged picture, premultiplied.
    low : (h, w, 4) float32 array
        The picture that it was made from.
    guide_alpha : (H, W) float32 array or None
        Alpha of the guides' render.
    scale : int
        Output pixels per low-resolution pixel along one axis.
    """
    height = low.shape[0]
    for top in range(0, height, _BAND):
        # one more row at each end: as far as interpolation and bounds look
        first, last = max(top - 1, 0), min(top + _BAND + 1, height)
        rows = slice(first * scale, last * scale)
        inner = slice((top - first) * scale, (top - first + _BAND) * scale)
        band, target = low[first:last], picture[rows]
        guide = None if guide_alpha is None else guide_alpha[rows]
        alpha = _upsample(band[..., 3], guide, target.shape[:2], scale)
        bounded = _bound_colour(target[..., :3], alpha, band, scale)
        target[inner, :, :3] = bounded[inner]
        target[inner, :, 3] = alpha[inner]


def _upsample(
    low: Array, guide: Array | None, shape: tuple[int, ...], scale: int
) -> Array:
    if guide is not None:
        return upsample_alpha(low, guide, scale)
    large = upsample_bilinear(to_planes(np.clip(low, 0.0, 1.0)[..., None]), scale)
    return to_picture(large)[: shape[0], : shape[1], 0]


def _bound_colour(radiance: Array, alpha: Array, low: Array, scale: int) -> Array:
    """Clamp the colour behind `alpha` to the range of the 3x3 pixels of `low`.

    Only near edges: where all nine are opaque, radiance may be anything. Light that
    covers nothing (alpha 0), such as a fire's, sets no upper bound.
    """
    height, width = alpha.shape
    limits = (_expand(x, scale)[:height, :width] for x in _find_colour_range(low))
    with np.errstate(invalid="ignore"):  # infinity times alpha 0
        darkest, brightest = (x * alpha[..., None] for x in limits)
    # fmin and fmax: a bound that is NaN is none
    return np.fmax(np.fmin(radiance, brightest), darkest)


def _find_colour_range(low: Array) -> tuple[Array, Array]:
    """Return the least and largest radiance / alpha around pixels, both (h, w, 3)."""
    radiance, alpha = low[..., :3], low[..., 3:]
    with np.errstate(all="ignore"):
        colour = radiance / alpha  # NaN where there is nothing
    darkest = -_largest_around(-np.nan_to_num(colour, nan=np.inf, posinf=np.inf))
    brightest = _largest_around(np.nan_to_num(colour, nan=0.0, posinf=np.inf))
    opaque = -_largest_around(-alpha) >= 1.0
    darkest[np.isinf(darkest) | opaque] = 0.0
    brightest[np.broadcast_to(opaque, brightest.shape)] = np.inf
    return darkest, brightest


def _largest_around(picture: Array) -> Array:
    pooled = functional.max_pool2d(
        to_planes(picture), kernel_size=3, stride=1, padding=1
    )
    return to_picture(pooled)


def _expand(picture: Array, scale: int) -> Array:
    return picture.repeat(scale, axis=0).repeat(scale, axis=1)
