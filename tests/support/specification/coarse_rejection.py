"""The first look at a neighbour: what the tiles of some pixels differ by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.support.specification.places import still_places
from xrds_core.accumulation.noise import brightness, luminance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from xrds_core.accumulation.reprojection import Pair

TILE = 64  # pixels across


def compared(pair: Pair, step: int) -> tuple[NDArray[np.float64], list[int]]:
    """Return the sums (4, rows, columns) of tiles, and the counts of pixels."""
    here, there = pair.here, pair.there
    height, width = here.shape
    tiles = -(-height // TILE), -(-width // TILE)
    y, x = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    spots = (y * width + x).ravel()
    places, in_frame = still_places(pair)
    at = np.maximum(places.pixel[spots], 0)
    still = np.ones(spots.size, bool)
    for frame, pixels in ((here, spots), (there, at)):
        if frame.invalid is not None:
            still &= ~frame.invalid[pixels]
    if pair.object_motion is not None:
        still &= ~np.isin(spots, pair.object_motion.pixels)
        still &= ~pair.object_motion.moving[at]
    inside, seen = in_frame[spots] & still, places.seen[spots] & still
    surface = (here.inverse_depth[spots] > 0) | (here.inverse_depth[spots] < 0)
    light = brightness if here.samples == there.samples else luminance
    own, other = (
        light(frame.picture[pixels, :3].astype(np.float32))
        for frame, pixels in ((here, spots), (there, at))
    )
    tile = (y // TILE * tiles[1] + x // TILE).ravel()[seen]
    parts = np.ones(spots.size), other - own, np.square(other - own), own
    sums = [
        np.bincount(tile, part[seen], minlength=tiles[0] * tiles[1]).reshape(tiles)
        for part in parts
    ]
    counts = [x.sum() for x in (inside, seen, inside & surface, seen & surface)]
    return np.array(sums), [*map(int, counts), int(surface.sum())]
