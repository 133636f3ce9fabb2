"""The least and the largest of the pixels around a pixel; NaN is passed over."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..arrays import Array


def extreme(x: NDArray[Any], smaller: np.ufunc, step: int = 1) -> NDArray[Any]:
    """Return the least (`np.fmin`) or largest (`np.fmax`) value of 3x3 pixels.

    Of masks `np.logical_or` says whether any pixel is in it. They lie `step` pixels
    apart, the middle one at the pixel itself.
    """
    wide = np.pad(x, step, "edge")
    end = slice(2 * step, None)
    rows = smaller(smaller(wide[: -2 * step], wide[step:-step]), wide[end])
    columns = smaller(rows[:, : -2 * step], rows[:, step:-step])
    return np.asarray(smaller(columns, rows[:, end]))


def extreme_at(
    x: Array,
    pixels: NDArray[np.integer],
    shape: tuple[int, int],
    smaller: np.ufunc,
) -> Array:
    """Return `extreme` (n,) of `x` (H W) at some flat pixels (n,) alone."""
    height, width = shape
    row, column = np.divmod(pixels, width)
    rows = [np.clip(row + i, 0, height - 1) * width for i in (-1, 0, 1)]
    columns = [np.clip(column + i, 0, width - 1) for i in (-1, 0, 1)]
    return np.asarray(reduce(smaller, (x.take(i + j) for i in rows for j in columns)))
