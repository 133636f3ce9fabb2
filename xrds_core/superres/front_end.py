"""Radiance to network space and back, with every value bounded.

NumPy pictures are float32 (height, width, channels), row 0 on top, scene-linear
Rec.709, radiance premultiplied by alpha. Torch tensors are (batch, channels,
height, width). `exposure` is the dimensionless factor e of one whole picture.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from ..arrays import Array
from ..errors import UsageError
from ..holes import fill_holes
from .regression import ALBEDO_EPSILON, explain

ArrayOrTensor = TypeVar("ArrayOrTensor", Array, Tensor)

TRANSFER_GAIN = 10.0
EXPOSURE_KEY = 0.18
EXPOSURE_RANGE = (1e-36, 1e36)  # times the gain, still a normal float32
LUMINANCE = (0.2126, 0.7152, 0.0722)  # Rec.709

_MOST_BINS = 16  # along each axis
# A sun or fireflies in a few bins must not make night of all others, so it is not the
# brightest bin that the others are held against.
_TYPICAL_BRIGHT = 0.95  # quantile of the bins with light
_FARTHEST_BIN = 1e4  # times brighter or darker: such bins say nothing of the exposure
_LARGEST = np.float32(3.4e38)  # blended tiles may round up and stay finite
# Of k e x: its square, over the epsilons that networks divide by, is a float32 still.
_LARGEST_EXPOSED = 1e18
LARGEST_TRANSFERRED = 88.0  # expm1 of 89 would leave float32


def clean_radiance(radiance: Array) -> tuple[Array, int]:
    """Replace pixels that hold no light.

    Parameters
    ----------
    radiance : (h, w, C) float32 array
        Scene-linear radiance, with alpha or without.

    Returns
    -------
    cleaned : (h, w, C) float32 array
        NaN and infinities are filled in, negative values are 0. `radiance` itself where
        nothing is wrong with it; else a copy.
    bad_pixels : int
        How many pixels were replaced.
    """
    if not radiance.size or (radiance.min() >= 0.0 and np.isfinite(radiance.max())):
        return radiance, 0
    finite = np.isfinite(radiance)
    bad = int((~finite | (radiance < 0.0)).any(axis=-1).sum())
    # before the holes are filled, so that none is filled with darkness below black
    return fill_holes(np.where(finite & (radiance < 0.0), np.float32(0.0), radiance))[
        0
    ], bad


def clean_albedo(albedo: Array) -> tuple[Array, int]:
    """Clean an albedo.

    Values above 1 are no fault: Cycles adds emission and background to its denoising
    albedo.

    Parameters
    ----------
    albedo : (H, W, 3) float32 array
        Albedo.

    Returns
    -------
    cleaned : (H, W, 3) float32 array
        In [0, 1].
    holes : int
        How many pixels held NaN or infinities.
    """
    albedo, holes = fill_holes(albedo)
    return np.clip(albedo, 0.0, 1.0), holes


def clean_normal(normal: Array) -> tuple[Array, int]:
    """Clean a normal; zero stays zero.

    Cycles' denoising normals are means of unit vectors, so shorter than 1 at edges:
    their length is information and is not normalised away.

    Parameters
    ----------
    normal : (H, W, 3) float32 array
        Normal.

    Returns
    -------
    cleaned : (H, W, 3) float32 array
        In [-1, 1].
    holes : int
        How many pixels held NaN or infinities.
    """
    normal, holes = fill_holes(normal)
    return np.clip(normal, -1.0, 1.0), holes


def auto_exposure(radiance: Array) -> float:
    """Return the exposure e: the key over the geometric mean luminance of bins.

    The picture is divided into at most 16 x 16 bins, whatever its size, so that a tiny
    render of a frame gives the frame's own exposure. Bins far from the bright ones, in
    either direction, are left out. This follows the auto-exposure of OIDN [1]_.

    Parameters
    ----------
    radiance : (h, w, 3 or more) float32 array
        Clean, low-resolution radiance.

    Returns
    -------
    exposure : float
        1 for a black picture.

    References
    ----------
    .. [1] Afra, A. T. (2019). Intel Open Image Denoise.
       https://www.openimagedenoise.org
    """
    luminance = radiance[..., :3].astype(np.float64) @ np.asarray(LUMINANCE)
    for axis in (0, 1):
        luminance = _bin_means(luminance, axis)
    lit = luminance[luminance > 0.0]
    if not lit.size:
        return 1.0
    bright = float(np.quantile(lit, _TYPICAL_BRIGHT, method="nearest"))
    seen = lit[(lit >= bright / _FARTHEST_BIN) & (lit <= bright * _FARTHEST_BIN)]
    exposure = EXPOSURE_KEY / math.exp(float(np.log(seen).mean()))
    return min(max(exposure, EXPOSURE_RANGE[0]), EXPOSURE_RANGE[1])


def choose_exposure(exposure: float | None, radiance: Array) -> float:
    """Return the requested exposure e, or else the one of the picture.

    Parameters
    ----------
    exposure : float or None
        The requested one.
    radiance : (h, w, 3 or more) float32 array
        Clean, low-resolution radiance.

    Returns
    -------
    exposure : float

    Raises
    ------
    UsageError
        If the exposure is beyond the range of float32 arithmetic.
    """
    if exposure is None:
        return auto_exposure(radiance)
    least, most = EXPOSURE_RANGE
    if not least <= exposure <= most:
        raise UsageError(f"exposure {exposure} is outside {least:g} to {most:g}")
    return float(exposure)


def _bin_means(luminance: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    size = luminance.shape[axis]
    bins = min(size, _MOST_BINS)
    edges = [i * size // bins for i in range(bins + 1)]
    means = [
        np.take(luminance, range(low, high), axis=axis).mean(axis=axis)
        for low, high in pairwise(edges)
    ]
    return np.stack(means, axis=axis) if means else luminance


def transfer(x: ArrayOrTensor, exposure: float | Tensor) -> ArrayOrTensor:
    """Return t(x) = log(1 + k e x) in float32, for radiance >= 0 of any range.

    Parameters
    ----------
    x : array or Tensor
        Scene-linear radiance.
    exposure : float or Tensor
        e; a tensor that broadcasts against `x` gives each picture its own.

    Returns
    -------
    t : array or Tensor
        Radiance in the transfer domain.
    """
    if isinstance(x, Tensor):
        exposed = x.float() * (TRANSFER_GAIN * exposure)
        return torch.log1p(exposed.clamp(0.0, _LARGEST_EXPOSED))
    with np.errstate(over="ignore"):
        exposed = x.astype(np.float32, copy=False) * _exposure_gain(exposure)
    return np.log1p(np.clip(exposed, 0.0, _LARGEST_EXPOSED))


def inverse_transfer(t: ArrayOrTensor, exposure: float | Tensor) -> ArrayOrTensor:
    """Return the radiance whose transfer is `t`; finite for every finite t."""
    if isinstance(t, Tensor):
        exposed = torch.expm1(t.float().clamp(max=LARGEST_TRANSFERRED))
        return (exposed / (TRANSFER_GAIN * exposure)).clamp(max=float(_LARGEST))
    with np.errstate(over="ignore"):
        t = t.astype(np.float32, copy=False)
        exposed = np.expm1(np.minimum(t, np.float32(LARGEST_TRANSFERRED)))
        return np.minimum(exposed / _exposure_gain(exposure), _LARGEST)


def _exposure_gain(exposure: float | Tensor) -> np.float32:
    return np.float32(TRANSFER_GAIN * float(exposure))


def area_mean(planes: Tensor, scale: int) -> Tensor:
    """Return the means of scale x scale blocks: (B, C, s h, s w) -> (B, C, h, w)."""
    return functional.avg_pool2d(planes, scale)


def upsample_bilinear(planes: Tensor, scale: int) -> Tensor:
    """Interpolate (B, C, h, w) -> (B, C, s h, s w): half-pixel centres, edges held."""
    if scale == 1:
        return planes
    return functional.interpolate(
        planes, scale_factor=float(scale), mode="bilinear", align_corners=False
    )


def demodulated_base(radiance: Array, albedo: Array, scale: int) -> Array:
    """Return up(L / down(A')) A' with A' = albedo + epsilon.

    Lighting is smoother than texture, so it is what is interpolated.

    Parameters
    ----------
    radiance : (h, w, 3) float32 array
        L: clean, scene-linear.
    albedo : (s h, s w, 3) float32 array
        Clean, in [0, 1].
    scale : int
        s

    Returns
    -------
    base : (s h, s w, 3) float32 array
        Radiance.
    """
    guide = to_planes(albedo) + ALBEDO_EPSILON
    return to_picture(_modulate(to_planes(radiance), guide, scale))


def regressed_base(
    radiance: Array, noisy: Array, albedo: Array, normal: Array, scale: int
) -> Array:
    """Return up(L / down(E)) E with E what the guides explain of L around every pixel.

    Unlike in `demodulated_base` the picture itself, with what it was before denoising,
    decides how much of the albedo and of the normal's shading goes into E, and gets
    back into L what denoising took of these: see `regression.explain`.

    Parameters
    ----------
    radiance : (h, w, 3) float32 array
        L: clean, scene-linear.
    noisy : (h, w, 3) float32 array
        The same before denoising.
    albedo, normal : (s h, s w, 3) float32 array
        Guides, clean.
    scale : int
        s

    Returns
    -------
    base : (s h, s w, 3) float32 array
        Radiance.
    """
    gain = _exposure_gain(auto_exposure(radiance))
    guides = torch.cat((to_planes(albedo), to_planes(normal)), dim=1)
    low, before = to_planes(radiance * gain), to_planes(noisy * gain)
    explained = explain(low, before, guides, scale)
    return to_picture(_modulate(explained.low, explained.factor, scale)) / gain


def _modulate(low: Tensor, modulator: Tensor, scale: int) -> Tensor:
    """Return up(L / down(M)) M, where M (B, C, s h, s w) is positive."""
    return upsample_bilinear(low / area_mean(modulator, scale), scale) * modulator


def pad_guide(guide: Array, low: Array, scale: int) -> Array:
    """Return a guide as far as the low-resolution pixels reach; its edge is repeated.

    Parameters
    ----------
    guide : (H, W, ...) array
        H <= s h, W <= s w.
    low : (h, w, ...) array
        The low-resolution picture.
    scale : int
        s

    Returns
    -------
    padded : (s h, s w, ...) array
    """
    missing = [
        (0, scale * size - have)
        for size, have in zip(low.shape[:2], guide.shape[:2], strict=True)
    ]
    return np.pad(guide, (*missing, *[(0, 0)] * (guide.ndim - 2)), "edge")


def upsample_alpha(low_alpha: Array, guide_alpha: Array, scale: int) -> Array:
    """Return alpha with the edges of the guides and the cover of the picture.

    It is exactly 0 or 1 wherever the low-resolution pixel and the guide both are.

    Parameters
    ----------
    low_alpha : (h, w) float32 array
        Alpha of the low-resolution picture.
    guide_alpha : (H, W) float32 array
        Alpha of the guides' render; H <= s h, W <= s w.
    scale : int
        s

    Returns
    -------
    alpha : (H, W) float32 array
    """
    height, width = guide_alpha.shape
    low = to_planes(np.clip(low_alpha, 0.0, 1.0)[..., None])
    padded = pad_guide(np.clip(guide_alpha, 0.0, 1.0), low_alpha, scale)
    guide = to_planes(padded[..., None])
    missing = upsample_bilinear(low - area_mean(guide, scale), scale)
    alpha = (guide + missing).clamp(0.0, 1.0)
    block = functional.interpolate(low, scale_factor=float(scale), mode="nearest")
    equal = (block == guide) & ((guide == 0.0) | (guide == 1.0))
    return to_picture(torch.where(equal, guide, alpha))[:height, :width, 0]


def to_planes(picture: Array) -> Tensor:
    """Return (H, W, C) as a float32 tensor (1, C, H, W) over the same memory.

    The channels stay side by side in it: convolutions add up such tensors in another
    order than those of separate planes, and so round otherwise.
    """
    pixels = torch.from_numpy(np.ascontiguousarray(picture, np.float32))
    return pixels.permute(2, 0, 1)[None]


def to_picture(planes: Tensor) -> Array:
    """Return a tensor (1, C, H, W) on any device as an array (H, W, C)."""
    return np.ascontiguousarray(planes[0].permute(1, 2, 0).cpu().numpy())
