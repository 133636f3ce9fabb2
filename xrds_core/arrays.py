"""The array type of pictures and guides; half floats, in which frames are stored.

Every array is float32 (height, width, channels) or (height, width), row 0 at the top,
and scene-linear where it holds colour, unless a docstring says otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import PictureError

Array = NDArray[np.float32]


def float_array(name: str, value: Any, channels: tuple[int, ...]) -> Array:
    """Return a picture as float32.

    Parameters
    ----------
    name : str
        Its name, for error messages.
    value : array_like
        The picture.
    channels : tuple of int
        The numbers of channels that it may have.

    Returns
    -------
    picture : (H, W, C) float32 array

    Raises
    ------
    PictureError
        If it has another shape, or holds no floats.
    """
    array = np.asarray(value)
    if array.ndim != 3 or array.shape[-1] not in channels or not array.size:
        wanted = " or ".join(map(str, channels))
        raise PictureError(
            f"{name} has the shape {array.shape}; it must be (height, width, {wanted})"
        )
    if array.dtype.kind != "f":
        raise PictureError(
            f"{name} holds {array.dtype}; it must hold scene-linear floats"
        )
    with np.errstate(over="ignore"):  # what float32 cannot hold is a bad pixel
        return array.astype(np.float32, copy=False)


LARGEST_HALF = 65504.0
# Every half float, by its bits.
_HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)


def floats(values: NDArray[Any]) -> Array:
    """Return values in float32; half floats from a table, in half of NumPy's time."""
    if values.dtype == np.float16:
        return np.asarray(_HALVES.take(np.ascontiguousarray(values).view(np.uint16)))
    return values.astype(np.float32, copy=False)
