"""Where a network has nothing to add, so that the base is the picture.

Arrays are those of `Inputs`; areas are low-resolution rows and columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from .front_end import demodulated_base, pad_guide
from .inputs import Inputs

Area = tuple[slice, slice]

# Of its largest value, what a constant may vary by: OIDN leaves about so much.
_EVEN = 2e-3
# Of its radiance, what a background's albedo may differ from it by.
_ALIKE = 0.05
# Below this share of idle pixels, finding the base costs what it saves.
_WORTH = 0.1
_BAND = 64  # low-resolution rows that the base is found for at once


def busy_area(inputs: Inputs, block: int, margin: int) -> Area | None:
    """Return the rectangle outside which the base is the picture.

    Blocks are idle where nothing but background is seen (normal 0, albedo that holds
    its radiance), or where every input is even.

    Parameters
    ----------
    inputs : Inputs
        The picture and its guides.
    block : int
        Side of a block, in low-resolution pixels; the rectangle is aligned to blocks.
    margin : int
        Least margin around what is busy, in low-resolution pixels.

    Returns
    -------
    area : tuple of slice or None
        Low-resolution rows and columns. None if nothing is busy; the whole picture if
        too little is idle.
    """
    height, width = inputs.low.shape[:2]
    whole = slice(0, height), slice(0, width)
    busy = ~_find_idle(inputs, block)
    if not busy.any():
        return None
    spans = (
        _find_span(busy.any(1), block, margin),
        _find_span(busy.any(0), block, margin),
    )
    rows, columns = (
        slice(start, min(stop, size))
        for (start, stop), size in zip(spans, (height, width), strict=True)
    )
    remaining = (rows.stop - rows.start) * (columns.stop - columns.start)
    return (rows, columns) if remaining < (1 - _WORTH) * height * width else whole


def write_base(picture: Array, inputs: Inputs) -> None:
    """Write the demodulated base into `picture` (H, W, 3), a band at a time."""
    height, scale = inputs.low.shape[0], inputs.scale
    for top in range(0, height, _BAND):
        # one more row at each end: as far as interpolation looks
        first, last = max(top - 1, 0), min(top + _BAND + 1, height)
        low = inputs.low[first:last, :, :3]
        albedo = inputs.albedo[first * scale : last * scale].clip(0.0, 1.0)
        base = demodulated_base(low, pad_guide(albedo, low, scale), scale)
        target = picture[top * scale : (top + _BAND) * scale]
        above = (top - first) * scale
        target[...] = base[above : above + len(target), : target.shape[1]]


def _find_idle(inputs: Inputs, block: int) -> NDArray[np.bool_]:
    """Return which blocks are idle, (rows, columns) of blocks."""
    full = block * inputs.scale
    low = _find_extremes(inputs.low, block)
    albedo = _find_extremes(inputs.albedo, full)
    normal = _find_extremes(inputs.normal, full)
    background = (normal[0] == 0).all(-1) & (normal[1] == 0).all(-1)
    background &= (albedo[1] <= 1.0).all(-1) & _shines_by_itself(inputs, block)
    even = _is_even(low) & _is_even(albedo) & _is_even(normal)
    return background | even


def _shines_by_itself(inputs: Inputs, block: int) -> NDArray[np.bool_]:
    """Return the blocks whose radiance is their albedo, like a background's."""
    low, scale = inputs.low[..., :3], inputs.scale
    albedo = np.minimum(inputs.albedo, 2.0)  # above 1 is no background anyway
    for axis in (0, 1):
        starts = range(0, albedo.shape[axis], scale)
        ends = np.append(starts[1:], albedo.shape[axis])
        counts = (ends - np.array(starts)).astype(np.float32)
        albedo = np.add.reduceat(albedo, starts, axis=axis)
        albedo /= counts.reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
    apart, bright = (_sum_blocks(x, block) for x in (np.abs(low - albedo), low))
    shines: NDArray[np.bool_] = apart <= _ALIKE * bright
    return shines


def _sum_blocks(picture: NDArray[Any], block: int) -> NDArray[np.float64]:
    """Return the sum over each block and its channels."""
    for axis in (0, 1):
        # float64: sums of the brightest light would leave float32
        starts = range(0, picture.shape[axis], block)
        picture = np.add.reduceat(picture, starts, axis=axis, dtype=np.float64)
    return np.asarray(picture.sum(-1))


def _is_even(extremes: tuple[Array, Array]) -> NDArray[np.bool_]:
    least, most = extremes
    largest = np.maximum(np.abs(least), np.abs(most)).max(-1)
    spread: NDArray[np.bool_] = (most - least).max(-1) <= _EVEN * largest
    return spread


def _find_extremes(picture: Array, block: int) -> tuple[Array, Array]:
    """Return the least and the largest value of each block, (rows, columns, C)."""
    starts = [range(0, size, block) for size in picture.shape[:2]]
    least = np.minimum.reduceat(picture, starts[0], axis=0)
    most = np.maximum.reduceat(picture, starts[0], axis=0)
    return (
        np.minimum.reduceat(least, starts[1], axis=1),
        np.maximum.reduceat(most, starts[1], axis=1),
    )


def _find_span(busy: NDArray[np.bool_], block: int, margin: int) -> tuple[int, int]:
    """Return first and last pixel of the busy blocks with whole blocks around them."""
    indices = np.flatnonzero(busy)
    around = -(-margin // block)
    return max(0, int(indices[0]) - around) * block, int(
        indices[-1] + 1 + around
    ) * block
