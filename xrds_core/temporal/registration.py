"""Registration: the offset of the nearest pixel, taken out by the frame itself.

A neighbour's sample is taken from the nearest pixel, whose centre lies up to half a
pixel (d) beside the true place x. It counts as N + G(x) - G(x + d), where N is the
sample and G the frame with the samples of the frames just before and after it. Nothing
noisy of a neighbour is interpolated, so noise stays uncorrelated from pixel to pixel,
as denoisers need it; and texture that G knows is not blurred.

Near a pixel's centre G is a polynomial of second degree in d. So a weighted sum over
neighbours needs only the weighted sums of the powers of d, the moments, and G is looked
at once for all of them.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from .frame import LARGEST_HALF
from .noise import brightness

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array

MOMENTS = 5
"""Of offsets: x, y, x squared, x times y, y squared."""
AS_DISTANCE = 0.25
"""What remains of an offset's square as distance once it is taken out: what G does not
know of texture."""
# Central differences of fourth order, from two pixels before to two pixels after. Those
# of second order left 0.4 dB of fine checks at 64 samples; a cubic spline's cost as
# much at 16, for they raise noise.
_SLOPE = (1 / 12, -8 / 12, 0.0, 8 / 12, -1 / 12)
_BEND = (-1 / 24, 16 / 24, -30 / 24, 16 / 24, -1 / 24)
_MARGIN = len(_SLOPE) // 2
_INNER = slice(_MARGIN, -_MARGIN)


def moments(x: Array, y: Array, weight: Array) -> Array:
    """Return those of offsets, times their weights: (n,) -> (MOMENTS, n)."""
    across, down = x * weight, y * weight
    return np.stack([across, down, x * across, x * down, y * down])


class Guess:
    """A picture of a frame, G: its `passes`, each (H, W, C), and where `has_light`, of
    the first of them, brightness. Kept in half floats.
    """

    def __init__(self, passes: Sequence[Array], has_light: bool) -> None:
        light = [brightness(passes[0])[..., None]] if has_light else []
        picture = np.concatenate([*passes, *light], axis=-1, dtype=np.float32)
        self._has_holes = not np.isfinite(picture).all()
        np.clip(picture, -LARGEST_HALF, LARGEST_HALF, out=picture)
        self._picture: NDArray[np.float16] = picture.astype(np.float16)

    def changes(self, rows: slice, moments: Sequence[Array]) -> list[Array]:
        """Return the sums of G(x) - G(x + d) over groups of neighbours, each (n, C).

        They are of some rows; `moments` are the sums over each group, (MOMENTS, n).
        0 beside pixels without samples.
        """
        height, width, channels = self._picture.shape
        wide = np.arange(rows.start - _MARGIN, rows.stop + _MARGIN)
        picture = self._picture[np.clip(wide, 0, height - 1)].astype(np.float32)
        picture = np.pad(picture, ((0, 0), (_MARGIN, _MARGIN), (0, 0)), "edge")
        shape = rows.stop - rows.start, width
        result = np.zeros((len(moments), *shape, channels), np.float32)
        for number, power in enumerate(_powers(picture)):
            for group, of_group in enumerate(moments):
                result[group] -= of_group[number].reshape(*shape, 1) * power
        if self._has_holes:
            result[~np.isfinite(result)] = 0.0
        return list(result.reshape(len(moments), -1, channels))


def _powers(picture: Array) -> Iterator[Array]:
    """Coefficients of the polynomial around each pixel, in the order of moments."""
    rows, columns = picture[:, _INNER], picture[_INNER]
    yield _filtered(columns, _SLOPE, 1)
    yield _filtered(rows, _SLOPE, 0)
    yield _filtered(columns, _BEND, 1)
    yield _filtered(_filtered(picture, _SLOPE, 1), _SLOPE, 0)
    yield _filtered(rows, _BEND, 0)


def _filtered(x: Array, kernel: Sequence[float], axis: int) -> Array:
    """Correlate (H, W, C) with a kernel, without its margin at both ends of an axis."""
    count = x.shape[axis] - 2 * _MARGIN
    parts = (
        np.float32(weight) * x[(slice(None),) * axis + (slice(first, first + count),)]
        for first, weight in enumerate(kernel)
        if weight
    )
    return reduce(np.add, parts)
