"""Means and extremes over squares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def extreme(x: Array, function: Any, reach: int) -> Array:
    """`np.fmin` or `np.fmax` of the pixels up to `reach` away, (H, W)."""
    height, width = x.shape
    wide = np.pad(x, reach, "edge")
    steps = range(2 * reach + 1)
    shifted = [wide[i : i + height, j : j + width] for i in steps for j in steps]
    return function.reduce(shifted)


def total(x: Array, before: int, after: int) -> Array:
    """The sum over those `before` and `after` each of (H, W), in both directions."""
    height, width = x.shape
    wide = np.pad(x, (before, after))
    steps = range(before + after + 1)
    shifted = (wide[i : i + height, j : j + width] for i in steps for j in steps)
    return np.asarray(sum(shifted))


def box(x: Array, size: int) -> Array:
    """The mean over `size` x `size` pixels, as far as they are in the picture."""
    reach = size // 2
    return total(x, reach, reach) / total(np.ones_like(x), reach, reach)


def mean(x: Array, valid: Array, size: int) -> Array:
    """The same of those `valid` (0 or 1)."""
    return box(x * valid, size) / np.maximum(box(valid, size), np.float32(1e-9))


def least_difference(x: Array) -> Array:
    """The smallest second difference of (H, W, C), in four directions."""
    height, width = x.shape[:2]
    wide = np.pad(x, ((1, 1), (1, 1), (0, 0)), "edge")

    def shifted(row: int, column: int) -> Array:
        return wide[1 + row : 1 + row + height, 1 + column : 1 + column + width]

    steps = ((0, 1), (1, 0), (1, 1), (1, -1))
    return np.minimum.reduce(
        [np.abs(x - (shifted(i, j) + shifted(-i, -j)) / 2) for i, j in steps]
    )
