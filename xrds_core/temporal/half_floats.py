"""Half floats, in which frames are stored, back in full."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array

LARGEST_HALF = 65504.0
# Every half float, by its bits.
_HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)


def floats(x: NDArray[Any]) -> Array:
    """Return `x` in float32; half floats from a table, in half of NumPy's time."""
    if x.dtype == np.float16:
        return np.asarray(_HALVES.take(np.ascontiguousarray(x).view(np.uint16)))
    return x.astype(np.float32, copy=False)
