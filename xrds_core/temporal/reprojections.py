"""Reprojections as the compiled library takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..native import structures
from .panorama import PanoramaReprojection

if TYPE_CHECKING:
    from ..native.library import Arrays
    from .motion import Reprojection


def for_library(
    transform: Reprojection, shape: tuple[int, int], arrays: Arrays
) -> structures.Reprojection:
    """Return the structure of a reprojection of pixels of a frame of a `shape`."""
    result = structures.Reprojection()
    if not isinstance(transform, PanoramaReprojection):
        result.matrix[:] = transform.ravel().tolist()
        return result
    result.matrix[:] = transform.turn.astype(np.float32).ravel().tolist()
    columns, rows = transform.directions(shape)
    result.columns = arrays.at(columns, np.float32, columns.size)
    result.rows = arrays.at(rows, np.float32, rows.size)
    result.left, result.top = transform.first
    result.across, result.down = transform.density
    result.window_x, result.window_y = transform.there.window
    return result
