"""Regions of a picture that consist of blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xrds_core.sequence.same_picture import BLOCK

from ...cycles.low_camera import Region

_LEAST_AREA = 200_000  # pixels that are measured in, where there are more


def measured_regions(shape: tuple[int, int]) -> list[Region]:
    """The parts of a picture (H, W) that show how large its errors are.

    Two strips from top to bottom, a quarter of a large picture and half of a smaller
    one; all where that would leave too few blocks.
    """
    height, width = shape
    for share in (0.25, 0.5):
        across = int(width * share / 2) // BLOCK * BLOCK
        if across >= BLOCK and across * height * 2 >= _LEAST_AREA:
            middles = (width // 4, 3 * width // 4)
            starts = [(x - across // 2) // BLOCK * BLOCK for x in middles]
            return [Region(x, 0, across, height) for x in starts]
    return [Region(0, 0, width, height)]


def blocks_beside(
    blocks: NDArray[np.bool_], regions: Sequence[Region]
) -> list[NDArray[np.bool_]]:
    """The blocks that are not in any of these strips, left, between and right."""
    if not regions:
        return [blocks]
    places = [_columns_of(region) for region in regions]
    ends = [0, *(x.stop for x in places)]
    starts = [*(x.start for x in places), blocks.shape[1]]
    found = []
    for first, last in zip(ends, starts, strict=True):
        part = np.zeros_like(blocks)
        part[:, first:last] = blocks[:, first:last]
        found.append(part)
    return found


def pixels_of(region: Region) -> tuple[slice, slice]:
    """Its rows and columns."""
    rows = slice(region.y, region.y + region.height)
    return rows, slice(region.x, region.x + region.width)


def _columns_of(region: Region) -> slice:
    """The columns of blocks that a region covers; it begins with one."""
    return slice(region.x // BLOCK, -(-(region.x + region.width) // BLOCK))


def region_of(rows: slice, columns: slice, shape: tuple[int, int]) -> Region:
    """A rectangle of blocks, in pixels of the picture."""
    top, left = rows.start * BLOCK, columns.start * BLOCK
    bottom = min(rows.stop * BLOCK, shape[0])
    right = min(columns.stop * BLOCK, shape[1])
    return Region(left, top, right - left, bottom - top)
