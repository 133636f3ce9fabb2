"""Minimum, maximum and mean over the pixels around each pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..arrays import Array


def extreme(x: NDArray[Any], smaller: np.ufunc, step: int = 1) -> NDArray[Any]:
    """Return the least (`np.fmin`) or largest (`np.fmax`) value of 3x3 pixels.

    NaN is ignored. On masks `np.logical_or` is a dilation. The pixels lie `step` apart,
    the middle one at the pixel itself.
    """
    wide = np.pad(x, step, "edge")
    end = slice(2 * step, None)
    rows = smaller(smaller(wide[: -2 * step], wide[step:-step]), wide[end])
    columns = smaller(rows[:, : -2 * step], rows[:, step:-step])
    return np.asarray(smaller(columns, rows[:, end]))


def box(x: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels, as far as they are in the picture.

    `size` is odd. (H, W) -> (H, W).
    """
    wide = np.pad(x, size // 2)
    rows = _sums(wide, x.shape[0], size)
    sums = _sums(rows.T, x.shape[1], size).T
    sums *= _shares(x.shape[0], size)[:, None]
    sums *= _shares(x.shape[1], size)
    return np.asarray(sums)


def _shares(side: int, size: int) -> Array:
    """Return 1 / how many of the `size` pixels around each one are in the picture."""
    inside = np.arange(side)
    first, last = np.maximum(inside - size // 2, 0), inside + size // 2
    return (1.0 / (np.minimum(last, side - 1) - first + 1)).astype(np.float32)


def _sums(x: Array, count: int, size: int) -> Array:
    """Return the sums of `size` consecutive rows, in thirds where possible."""
    if size > 3 and size % 3 == 0:
        third = size // 3
        part = _sums(x, count + 2 * third, third)
        return np.asarray(
            part[:count] + part[third : third + count] + part[2 * third :]
        )
    total = x[:count].copy()
    for i in range(1, size):
        total += x[i : i + count]
    return total
