"""A first look at a neighbour, at some of its pixels: is it the same shot and light?

Two things need more pixels than the judge of each pixel has around it. A
frame from before a cut fits nearly nowhere, and where its geometry fits by chance it
must lend nothing either. And light that changes a little over a large part of the
picture, as a lamp that flickers or a fade, drowns in the noise of a few pixels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .motion import Grid, still_places
from .noise import brightness, luminance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored
    from .motion import Pair

    Mask = NDArray[np.bool_]

TILE = 64  # pixels across, of what gets one weight
# Between the pixels looked at, along each axis, in small and in large pictures.
_STRIDES, _LARGE = (2, 4), 1_000_000
# Of the hits that lie within the other frame: fewer that agree are a cut.
_LEAST_SHARE = 1 / 3
# Tested are tiles, 3x3 tiles, and the whole picture.
_REACHES = (0, 1, None)
_NOISE, _FALL = 4.0, 2.0  # z squared is 1 on the mean where frames agree
# Of the brightness: a difference that no one sees, however sure it is.
_HARMLESS = 0.01


def survey(pair: Pair) -> Array:
    """Return the weights (rows, columns) of tiles of `pair.here`, 0 after a cut."""
    height, width = pair.here.shape
    tiles = -(-height // TILE), -(-width // TILE)
    if pair.here.is_empty:  # there is nothing to compare
        return np.ones(tiles, np.float32)
    step = _STRIDES[height * width >= _LARGE]
    y, x = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    spots = (y * width + x).ravel()
    half = np.float32(0.5)
    grid = Grid(spots, x.ravel().astype(np.float32) + half, y.ravel() + half)
    found, landed = still_places(pair, grid)
    still = _still(pair, spots, found.pixel)
    seen = found.seen & still
    if _is_cut(pair, step, spots, seen, landed & still):
        return np.zeros(tiles, np.float32)
    alike = pair.here.samples == pair.there.samples
    own = _brightness(pair.here, spots, alike)
    other = _brightness(pair.there, found.pixel, alike)
    tile = (y // TILE * tiles[1] + x // TILE).ravel()[seen]
    difference = (other - own)[seen]
    sums = [
        np.bincount(tile, part, minlength=tiles[0] * tiles[1])
        .astype(np.float64)
        .reshape(tiles)
        for part in (np.ones(len(tile)), difference, difference**2, own[seen])
    ]
    return _weights(sums)


def spread(tiles: Array, shape: tuple[int, int], rows: slice) -> Array:
    """Return the weights (h, W) of some rows: linear between the middles of tiles."""
    down = _hats(tiles.shape[0], np.arange(rows.start, rows.stop))
    across = _hats(tiles.shape[1], np.arange(shape[1]))
    return np.asarray(down.T @ tiles @ across)


def _hats(tiles: int, pixels: NDArray[np.integer]) -> Array:
    """Return (tiles, n): what share each tile has in each pixel, along one axis."""
    place = np.clip((pixels + 0.5) / TILE - 0.5, 0, tiles - 1)
    hats = 1 - np.abs(place - np.arange(tiles)[:, None])
    return np.maximum(hats, 0.0).astype(np.float32)


def _is_cut(
    pair: Pair, step: int, spots: NDArray[np.intp], seen: Mask, landed: Mask
) -> bool:
    """Tell whether too few of the spots that landed show the same.

    The sky is left out, if there is anything else: every view has the same.
    """
    near = pair.here.nearness[spots]
    hit = (near > 0.0) | (near < 0.0)
    if hit.any():
        seen, landed = seen & hit, landed & hit
    moved, followed = _moving(pair, step)
    asked = landed.sum() + moved
    return bool(asked == 0 or seen.sum() + followed < _LEAST_SHARE * asked)


def _still(pair: Pair, here: NDArray[np.intp], there: NDArray[np.int32]) -> Mask:
    """Return where neither frame shows what moves by itself, or is spoilt."""
    result = np.ones(len(here), bool)
    for frame, pixels in ((pair.here, here), (pair.there, there)):
        if frame.spoilt is not None:
            result &= ~frame.spoilt[pixels]
    if pair.detour is not None:
        result &= ~np.isin(here, pair.detour.pixels) & ~pair.detour.moving[there]
    return result


def _moving(pair: Pair, step: int) -> tuple[float, float]:
    """Return how many spots show what moves by itself, and how many are followed."""
    if pair.detour is None:
        return 0.0, 0.0
    followed = np.count_nonzero(np.isfinite(pair.detour.x))
    return len(pair.detour.pixels) / step**2, followed / step**2


def _brightness(frame: Stored, pixels: NDArray[np.integer], alike: bool) -> Array:
    """Return the root of luminance (n,), or itself where frames are not `alike`.

    Between frames of other sample counts the root would lie: less noise has a larger
    mean root.
    """
    light = frame.picture[pixels, :3].astype(np.float32)
    return brightness(light) if alike else luminance(light)


def _weights(sums: list[NDArray[np.float64]]) -> Array:
    """Return weights from count, sum, sum of squares of differences, and brightness."""
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
