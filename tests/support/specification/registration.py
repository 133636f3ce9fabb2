"""Sums of G(x + d) - G(x), from the weighted sums of the powers of d."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tests.support.specification.filters import Array, extreme

SLOPE = np.array([1, -8, 0, 8, -1], np.float32) / 12
BEND = np.array([-1, 16, -30, 16, -1], np.float32) / 24


def moments(x: Array, y: Array, weight: Array) -> Array:
    """Those of offsets, times their weights: (n,) -> (5, n)."""
    return np.stack([x, y, x * x, x * y, y * y]) * weight


def changes(guess: Array, summed: Array) -> Array:
    """What offsets change, (n, H W), of a guess (n, H, W) and moments (5, H W)."""
    result = np.zeros((len(guess), summed.shape[1]), np.float32)
    for k, plane in enumerate(guess.astype(np.float32)):
        with np.errstate(invalid="ignore"):
            for power, moment in zip(_powers(plane), summed, strict=True):
                result[k] += moment * power.ravel()
    return result


def registered(
    sums: Array, weights: Array, guess: Array, summed: Array
) -> tuple[Array, Array]:
    """Sums (n, H W) of samples with weights (H W,) less what offsets change.

    Neither the guess (n, H, W) at the pixels taken nor what becomes of the sums leaves
    the range of the guess in 3 x 3 pixels, but where sums were outside before. Also the
    shares of changes that count.
    """
    result, shares = np.array(sums, np.float32), np.ones(sums.shape, np.float32)
    told = changes(guess, summed)
    for k, plane in enumerate(guess.astype(np.float32)):
        known = np.isfinite(told[k])  # not beside pixels without samples
        change = np.where(known, told[k], np.float32(0))
        near = (plane, extreme(plane, np.fmin, 1), extreme(plane, np.fmax, 1))
        with np.errstate(invalid="ignore", divide="ignore"):
            here, least, most = (x.ravel() * weights for x in near)
            found = result[k] - np.clip(change, least - here, most - here)
            least, most = np.fmin(result[k], least), np.fmax(result[k], most)
            kept = np.where(known, np.clip(found, least, most), result[k])
            share = np.clip((result[k] - kept) / change, 0, 1)
        shares[k] = np.where(kept == result[k] - change, np.float32(1), share)
        result[k] = kept
    return result, shares


def _powers(plane: Array) -> Iterator[Array]:
    """Coefficients of the polynomial around each pixel (H, W), as moments are."""
    across = _filtered(plane, SLOPE, 1)
    yield across
    yield _filtered(plane, SLOPE, 0)
    yield _filtered(plane, BEND, 1)
    yield _filtered(across, SLOPE, 0)
    yield _filtered(plane, BEND, 0)


def _filtered(x: Array, kernel: Array, axis: int) -> Array:
    wide = np.pad(x, [(2, 2) if k == axis else (0, 0) for k in range(2)], "edge")
    shifted = (np.roll(wide, 2 - k, axis) for k in range(5))
    found = sum(w * part for w, part in zip(kernel, shifted, strict=True) if w)
    return np.take(found, range(2, 2 + x.shape[axis]), axis)
