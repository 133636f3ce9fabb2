"""Coarse rejection: weights of tiles, from some pixels of a neighbour frame.

Two things need more pixels than the similarity weight of each pixel looks at. A frame
beyond a shot cut matches almost nowhere, and must not contribute where its geometry
matches by coincidence. And light that changes a little over a large part of the
picture, because a lamp flickers or the scene fades, is hidden by the noise of a few
pixels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .reprojection import spot_stride
from .weighted_sums import compare_spots, tile_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .reprojection import Pair
    from .weighted_sums import Compared


# Of the hits that reproject into the other frame: if fewer match, it is a shot cut.
_LEAST_SHARE = 1 / 3
# Radii in tiles: tests single tiles, 3x3 tiles, and the whole picture.
_REACHES = (0, 1, None)
_NOISE, _FALL = 4.0, 2.0  # z squared is 1 on average where frames match
# Relative to brightness: a difference that no one sees, however significant.
_HARMLESS = 0.01


def tile_weights(pair: Pair) -> Array:
    """Return a weight for each tile of a neighbour frame.

    Parameters
    ----------
    pair : Pair
        The frame (`here`) and its neighbour (`there`).

    Returns
    -------
    weights : (rows, columns) float32 array
        From 0 to 1 for each tile of `pair.here`; 0 everywhere across a shot cut.
    """
    tiles = tile_grid(pair.here.shape)
    if pair.here.is_empty:  # there is nothing to compare
        return np.ones(tiles, np.float32)
    step = spot_stride(pair.here.shape)
    comparison = compare_spots(pair, step)
    if _is_shot_cut(pair, step, comparison):
        return np.zeros(tiles, np.float32)
    return _weigh_tiles(comparison.tiles)


def _is_shot_cut(pair: Pair, step: int, comparison: Compared) -> bool:
    """Whether too few of the pixels that are in both frames match.

    The sky is left out if there is anything else: it looks the same in every view.
    """
    moved, followed = _count_moving(pair, step)
    if comparison.surfaces:
        compared, matching = comparison.compared_surfaces, comparison.matching_surfaces
    else:
        compared, matching = comparison.compared, comparison.matching
    most = compared + moved
    return most == 0 or matching + followed < _LEAST_SHARE * most


def _count_moving(pair: Pair, step: int) -> tuple[float, float]:
    """Return how many pixels show moving objects, and how many could be followed."""
    if pair.object_motion is None:
        return 0.0, 0.0
    followed = np.count_nonzero(np.isfinite(pair.object_motion.x))
    return len(pair.object_motion.pixels) / step**2, followed / step**2


def _weigh_tiles(sums: NDArray[np.float64]) -> Array:
    """Return weights from the sums of tiles."""
    weights = np.ones(sums.shape[1:])
    for reach in _REACHES:
        count, total, squares, bright = (_sum_around(x, reach) for x in sums)
        count = np.maximum(count, 1.0)
        mean = total / count
        noise = np.maximum(squares / count - mean**2, 0.0) / count
        bearable = _FALL * noise + (_HARMLESS * bright / count) ** 2
        beyond = np.maximum(mean**2 - _NOISE * noise, 0.0)
        weights = np.minimum(weights, 1 / (1 + beyond / np.maximum(bearable, 1e-30)))
    return weights.astype(np.float32)


def _sum_around(sums: NDArray[np.float64], reach: int | None) -> NDArray[np.float64]:
    """Return the sums over tiles up to `reach` away; over all of them for None."""
    if reach is None:
        return np.full(sums.shape, sums.sum())
    wide = np.pad(sums, reach)
    height, width = sums.shape
    shifts = range(2 * reach + 1)
    return np.sum(
        [wide[i : i + height, j : j + width] for i in shifts for j in shifts], 0
    )
