"""Pixels that hold no number or no light: filled in, and counted.

Arrays are float32 (height, width, channels).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .arrays import Array


BRIGHTEST = 1e12
"""Radiance above it is a renderer's overflow: the sun's is about 1e7 W / (m2 sr)."""
_LARGEST = np.finfo(np.float32).max


def describe_bad_pixels(bad_pixels: int) -> str:
    """Return a message about bad pixels."""
    return f"replaced {bad_pixels} bad pixels: NaN, infinities or negative light"


def clean_radiance(radiance: Array) -> tuple[Array, int]:
    """Replace pixels that hold no light.

    Parameters
    ----------
    radiance : (..., C) float32 array
        Scene-linear radiance.

    Returns
    -------
    cleaned : (..., C) float32 array
        NaN, infinities and overflows are filled in, negative values are 0. `radiance`
        itself where nothing is wrong with it; else a copy.
    bad_pixels : int
        How many pixels were replaced.
    """
    # min and max propagate NaN and need no array of the size of the picture
    if not radiance.size or (radiance.min() >= 0.0 and radiance.max() <= BRIGHTEST):
        return radiance, 0
    known = np.abs(radiance) <= BRIGHTEST
    bad = int((~known | (radiance < 0.0)).any(axis=-1).sum())
    # negative light first, so that no hole is filled with it
    lit = np.where(known & (radiance < 0.0), np.float32(0.0), radiance)
    return _pull_push(lit, known.all(axis=-1)), bad


def clean_alpha(alpha: Array) -> tuple[Array, int]:
    """Fill in NaN and infinities of an alpha; 1 where no pixel has a valid alpha.

    So a picture without a valid alpha keeps its colour.

    Parameters
    ----------
    alpha : (H, W, 1) float32 array
        Alpha.

    Returns
    -------
    cleaned : (H, W, 1) float32 array
    holes : int
        How many pixels were filled in.
    """
    filled, holes = fill_holes(alpha)
    return (
        (np.ones_like(alpha), holes)
        if holes and holes == alpha.size
        else (filled, holes)
    )


def fill_holes(picture: Array) -> tuple[Array, int]:
    """Fill in NaN and infinities with the mean of finite pixels near them.

    Parameters
    ----------
    picture : (H, W, C) float32 array
        A picture.

    Returns
    -------
    filled : (H, W, C) float32 array
        `picture` itself where it has no holes; 0 where it has no finite pixel.
    holes : int
        How many pixels were filled in.
    """
    if not picture.size or (np.isfinite(picture.min()) and np.isfinite(picture.max())):
        return picture, 0
    known = np.isfinite(picture).all(axis=-1)
    return _pull_push(picture, known), int(known.size - known.sum())


def _pull_push(picture: Array, known: NDArray[np.bool_]) -> Array:
    """Fill unknown pixels from the means of 2x2 blocks, coarser where need be."""
    if known.all():
        return picture
    picture = np.where(known[..., None], picture, np.float32(0.0))
    if not known.any():
        return picture
    height, width = known.shape
    even = ((0, height % 2), (0, width % 2))
    blocks = np.pad(picture, (*even, (0, 0))) * np.float32(0.25)  # sums stay in range
    counts = np.pad(known, even).astype(np.float32) * np.float32(0.25)
    for axis in (0, 1):
        blocks = _sum_pairs(blocks, axis)
        counts = _sum_pairs(counts, axis)
    means = blocks / np.maximum(counts, np.float32(0.25))[..., None]
    coarse = _pull_push(np.clip(means, -_LARGEST, _LARGEST), counts > 0.0)
    fine = coarse.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    return np.where(known[..., None], picture, fine)


def _sum_pairs(blocks: Array, axis: int) -> Array:
    even, odd = (
        np.take(blocks, range(i, blocks.shape[axis], 2), axis=axis) for i in (0, 1)
    )
    return np.asarray(even + odd)
