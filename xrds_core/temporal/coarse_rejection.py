"""Coarse rejection: weights of tiles, from some pixels of a neighbour frame.

Two things need more pixels than the similarity weight of each pixel looks at. A frame
beyond a shot cut matches almost nowhere, and must not contribute where its geometry
matches by coincidence. And light that changes a little over a large part of the
picture, as a flickering lamp or a fade, is hidden by the noise of a few pixels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .motion import spot_stride
from .noise import brightness, luminance
from .sums import find_spots

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored
    from .motion import Pair

    Mask = NDArray[np.bool_]

TILE = 64  # pixels across
# Of the hits that reproject into the other frame: if fewer match, it is a shot cut.
_LEAST_SHARE = 1 / 3
# Radii in tiles: tests single tiles, 3x3 tiles, and the whole picture.
_REACHES = (0, 1, None)
_NOISE, _FALL = 4.0, 2.0  # z squared is 1 on average where frames match
# Relative to brightness: a difference that no one sees, however significant.
_HARMLESS = 0.01


def tile_weights(pair: Pair) -> Array:
    """Return the weights (rows, columns) of `pair.here`'s tiles, 0 across a cut."""
    height, width = pair.here.shape
    tiles = -(-height // TILE), -(-width // TILE)
    if pair.here.is_empty:  # there is nothing to compare
        return np.ones(tiles, np.float32)
    step = spot_stride(pair.here.shape)
    y, x = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    spots = (y * width + x).ravel()
    there, seen, in_frame = find_spots(pair, step)
    still = _still(pair, spots, there)
    seen &= still
    if _is_shot_cut(pair, step, spots, seen, in_frame & still):
        return np.zeros(tiles, np.float32)
    alike = pair.here.samples == pair.there.samples
    own = _brightness(pair.here, spots, alike)
    other = _brightness(pair.there, there, alike)
    tile = (y // TILE * tiles[1] + x // TILE).ravel()[seen]
    difference = (other - own)[seen]
    sums = [
        np.bincount(tile, part, minlength=tiles[0] * tiles[1])
        .astype(np.float64)
        .reshape(tiles)
        for part in (np.ones(len(tile)), difference, difference**2, own[seen])
    ]
    return _weights(sums)


def _is_shot_cut(
    pair: Pair, step: int, spots: NDArray[np.intp], seen: Mask, in_frame: Mask
) -> bool:
    """Whether too few of the pixels that are in both frames match.

    The sky is left out if there is anything else: it looks the same in every view.
    """
    near = pair.here.inverse_depth[spots]
    hit = (near > 0.0) | (near < 0.0)
    if hit.any():
        seen, in_frame = seen & hit, in_frame & hit
    moved, followed = _moving(pair, step)
    compared = in_frame.sum() + moved
    return bool(compared == 0 or seen.sum() + followed < _LEAST_SHARE * compared)


def _still(pair: Pair, here: NDArray[np.intp], there: NDArray[np.int32]) -> Mask:
    """Return where neither frame shows a moving object or an invalid pixel."""
    result = np.ones(len(here), bool)
    for frame, pixels in ((pair.here, here), (pair.there, there)):
        if frame.invalid is not None:
            result &= ~frame.invalid[pixels]
    if pair.object_motion is not None:
        result &= (
            ~np.isin(here, pair.object_motion.pixels)
            & ~pair.object_motion.moving[there]
        )
    return result


def _moving(pair: Pair, step: int) -> tuple[float, float]:
    """Return how many pixels show moving objects, and how many could be followed."""
    if pair.object_motion is None:
        return 0.0, 0.0
    followed = np.count_nonzero(np.isfinite(pair.object_motion.x))
    return len(pair.object_motion.pixels) / step**2, followed / step**2


def _brightness(frame: Stored, pixels: NDArray[np.integer], alike: bool) -> Array:
    """Return the square root of luminance (n,), or luminance if not `alike`.

    Between frames of different sample counts the root would be biased: less noise has
    a larger mean root.
    """
    light = frame.picture[pixels, :3].astype(np.float32)
    return brightness(light) if alike else luminance(light)


def _weights(sums: list[NDArray[np.float64]]) -> Array:
    """Return weights from sums: count, differences, their squares, and brightness."""
    weights = np.ones(sums[0].shape)
    for reach in _REACHES:
        count, total, squares, bright = (_around(x, reach) for x in sums)
        count = np.maximum(count, 1.0)
        mean = total / count
        noise = np.maximum(squares / count - mean**2, 0.0) / count
        bearable = _FALL * noise + (_HARMLESS * bright / count) ** 2
        beyond = np.maximum(mean**2 - _NOISE * noise, 0.0)
        weights = np.minimum(weights, 1 / (1 + beyond / np.maximum(bearable, 1e-30)))
    return weights.astype(np.float32)


def _around(x: NDArray[np.float64], reach: int | None) -> NDArray[np.float64]:
    """Return the sums over tiles up to `reach` away; over all of them for None."""
    if reach is None:
        return np.full(x.shape, x.sum())
    wide = np.pad(x, reach)
    height, width = x.shape
    shifts = range(2 * reach + 1)
    return np.sum(
        [wide[i : i + height, j : j + width] for i in shifts for j in shifts], 0
    )
