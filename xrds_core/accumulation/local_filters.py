"""Minimum, maximum and mean over the pixels around each pixel, and of blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..native.library import Arrays, bands, in_threads, library

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..arrays import Array


def extreme(plane: NDArray[Any], smaller: np.ufunc, step: int = 1) -> NDArray[Any]:
    """Return the least or largest value of the 3x3 pixels around each pixel.

    Parameters
    ----------
    plane : (H, W) array
        Values; NaN is ignored.
    smaller : ufunc
        `np.fmin` or `np.fmax`; on masks `np.logical_or`, which makes a dilation.
    step : int
        Distance between the 3x3 pixels; the middle one lies at the pixel itself.

    Returns
    -------
    (H, W) array
    """
    wide = np.pad(plane, step, "edge")
    end = slice(2 * step, None)
    rows = smaller(smaller(wide[: -2 * step], wide[step:-step]), wide[end])
    columns = smaller(rows[:, : -2 * step], rows[:, step:-step])
    return np.asarray(smaller(columns, rows[:, end]))


def box(plane: Array, size: int) -> Array:
    """Return the mean over a square around each pixel, within the picture.

    Parameters
    ----------
    plane : (H, W) float32 array
        Values.
    size : int
        Pixels along a side; odd.

    Returns
    -------
    means : (H, W) float32 array
    """
    wide = np.pad(plane, size // 2)
    rows = _sum_rows(wide, plane.shape[0], size)
    sums = _sum_rows(rows.T, plane.shape[1], size).T
    sums *= _inverse_counts(plane.shape[0], size)[:, None]
    sums *= _inverse_counts(plane.shape[1], size)
    return np.asarray(sums)


def _inverse_counts(side: int, size: int) -> Array:
    """Return 1 / how many of the `size` pixels around each one are in the picture."""
    inside = np.arange(side)
    first, last = np.maximum(inside - size // 2, 0), inside + size // 2
    return (1.0 / (np.minimum(last, side - 1) - first + 1)).astype(np.float32)


def _sum_rows(plane: Array, count: int, size: int) -> Array:
    """Return the sums of `size` consecutive rows, in thirds where possible."""
    if size > 3 and size % 3 == 0:
        third = size // 3
        part = _sum_rows(plane, count + 2 * third, third)
        return np.asarray(
            part[:count] + part[third : third + count] + part[2 * third :]
        )
    total = plane[:count].copy()
    for i in range(1, size):
        total += plane[i : i + count]
    return total


def find_rims(
    depth: Array, shape: tuple[int, int], nearer_is_less: bool
) -> NDArray[np.uint8]:
    """Find pixels next to a nearer surface: they contain some of its light.

    Parameters
    ----------
    depth : (H W,) float32 array
        Inverse depth, NaN where unknown; or depth where `nearer_is_less`.
    shape : tuple of int
        Height and width.
    nearer_is_less : bool
        Whether a smaller value is nearer.

    Returns
    -------
    rims : (H W,) uint8 array
        0, or 1 + which of the 3x3 pixels around has the nearest surface.
    """
    height, width = shape
    rims = np.empty(height * width, np.uint8)
    arrays = Arrays()
    addresses = arrays.at(depth, np.float32, rims.size), rims.ctypes.data

    def work(rows: tuple[int, int]) -> None:
        library().find_rims(*addresses, width, height, *rows, nearer_is_less)

    in_threads(work, bands(height))
    return rims


def find_ranges(depth: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Find the range of depth in the 9x9 pixels around each pixel, with some slack.

    Parameters
    ----------
    depth : (H W,) float32 array
        Depth or inverse depth, NaN where unknown.
    shape : tuple of int
        Height and width.

    Returns
    -------
    least, most : (H W,) float32 array
        The range; NaN where nothing is known around.
    """
    height, width = shape
    least, most = np.empty((2, height * width), np.float32)
    arrays = Arrays()
    addresses = [arrays.at(x, np.float32, depth.size) for x in (depth, least, most)]

    def work(rows: tuple[int, int]) -> None:
        scratch = np.empty(2 * (width + 8), np.float32)
        library().find_ranges(*addresses, width, height, *rows, scratch.ctypes.data)

    in_threads(work, bands(height))
    return least, most


BLOCK = 32  # pixels across


def block_means(plane: Array, size: int = BLOCK) -> Array:
    """Return means of blocks from the top left; those at the edges may be smaller."""
    starts = [np.arange(0, side, size) for side in plane.shape]
    sums, counts = (
        np.add.reduceat(np.add.reduceat(x, starts[0], axis=0), starts[1], axis=1)
        for x in (plane.astype(np.float64), np.ones(plane.shape))
    )
    return np.asarray(sums / counts)
