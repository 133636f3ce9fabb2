"""Whether a neighbour's samples show the same light as the frame's own.

Reflections, shadows, flickering lamps and whatever else geometry does not tell make
frames differ where the surface is the same. The frame's own noisy samples say so: the
differences between them and a neighbour's, summed over the pixels around, are compared
with their own spread. One neighbour at a time is asked, so that both sides hold the
same noise: rare bright samples that are missing on one side are missing on the other,
too. A mean of many frames, or a denoised one, would look brighter than a single frame.
Of what moves by itself the guides must agree as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array

    Mask = NDArray[np.bool_]

REACH = 3  # pixels to each side that are summed: 7x7
# z squared is 1 on the mean where frames agree, and above 4 in one pixel of twenty.
_NOISE = 4.0
_FALL = 2.0
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec.709
_TINY = np.float32(1e-30)
# Of albedo and normal: the difference, root mean square over 3x3 pixels, at which a
# thing that moves by itself lends half. Normals turn as it turns, so they count less.
_ALIKE, _NORMAL_SHARE = 0.4, 0.25


def brightness(radiance: Array, alike: bool = True) -> Array:
    """Return the root of the luminance (..., 3) -> (...).

    The root makes the noise of dark and bright pixels alike, so that a few bright ones
    do not outvote the others. Between frames of other sample counts it would lie:
    less noise has a larger mean root. So those (not `alike`) keep the luminance.
    """
    light = np.maximum(radiance @ _LUMINANCE, np.float32(0.0))
    return np.sqrt(light) if alike else light


def agreement(difference: Array) -> Array:
    """Return the weights (H, W) in (0, 1] of a neighbour's samples.

    `difference` (H, W): brightness of the neighbour minus the frame's own, 0 where
    nothing is lent, as beyond its ends.
    """
    count = np.float32((2 * REACH + 1) ** 2)
    wide = np.pad(difference, REACH)
    square = np.square(_box(wide))
    spread = _box(np.square(wide)) - square / count
    with np.errstate(over="ignore"):  # light beyond all measure agrees with none
        z2 = square / np.maximum(spread, _TINY)
    return np.float32(1.0) / (
        np.float32(1.0) + np.maximum(z2 - np.float32(_NOISE), 0.0) / np.float32(_FALL)
    )


def likeness(difference: Array, seen: Mask) -> Array:
    """Return the weights (H, W) in (0, 1] of what moves by itself.

    `difference` (H, W, 6): albedo and normal of the neighbour minus the frame's own,
    where the neighbour is `seen` (H, W). What moves may be a pane, or may shine, and
    then light and guides do not move with it. In their noise the test of light finds
    that too late; guides that are the same, pixel by pixel, tell that it is neither.
    """
    square = np.square(difference)
    apart = square[..., :3].sum(axis=-1)
    apart += np.float32(_NORMAL_SHARE) * square[..., 3:].sum(axis=-1)
    mean = _box3(apart * seen) / np.maximum(_box3(seen.astype(np.float32)), _TINY)
    return np.float32(1.0) / (np.float32(1.0) + np.square(mean / _ALIKE**2))


def _box3(x: Array) -> Array:
    """Return the sums of 3x3 pixels, (H, W) -> (H, W)."""
    wide = np.pad(x, 1)
    rows = wide[:-2] + wide[1:-1] + wide[2:]
    return np.asarray(rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:])


def _box(x: Array) -> Array:
    """Return the sums of 7x7 pixels: (H, W) -> (H - 6, W - 6), as 4 + 2 + 1 rows."""
    two = x[:-1] + x[1:]
    x = two[:-5] + two[2:-3] + two[4:-1] + x[6:]
    two = x[:, :-1] + x[:, 1:]
    return np.asarray(two[:, :-5] + two[:, 2:-3] + two[:, 4:-1] + x[:, 6:])
