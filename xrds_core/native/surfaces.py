"""What depths tell of surfaces: which lie beside nearer ones, how deep they reach."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .library import Arrays, library
from .threads import bands, in_threads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array


def find_rims(
    depth: Array, shape: tuple[int, int], nearer_is_less: bool
) -> NDArray[np.uint8]:
    """Return (H W): pixels next to a nearer surface, some of whose light they contain.

    0, or 1 + which of the 3x3 pixels around has the nearest surface. `depth` (H W) is
    inverse depth, NaN where unknown, or depth where `nearer_is_less`.
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
    """Return the least and the largest `depth` (H W) of the 9x9 pixels around each one,
    with some slack; NaN where nothing is known around.
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
