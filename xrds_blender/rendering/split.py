"""Two pictures of the same view in one, with a line between them."""

from __future__ import annotations

import numpy as np

from xrds_core.arrays import Array

_LINE = 1.0  # its brightness
_THIN = 960  # pixels of width for each of the line's


def line_width(width: int) -> int:
    """Pixels of the line in a picture so wide."""
    return max(1, width // _THIN)


def split_picture(left: Array, right: Array) -> Array:
    """The left half of one picture (H, W, 4), and the right half of the other."""
    mixed = np.empty(left.shape, np.float32)
    draw_split(mixed, left, right, left.shape[1] // 2)
    return mixed


def draw_split(
    mixed: Array, left: Array, right: Array, place: int, before: int | None = None
) -> None:
    """Let `mixed` (H, W, 4) show one picture left of a column, the other right of it.

    With the place `before`, all columns but those between both are right already.
    """
    width, line = mixed.shape[1], line_width(mixed.shape[1])
    first, last = 0, width
    if before is not None:
        first, last = min(before, place), min(max(before, place) + line, width)
    mixed[:, first:place] = left[:, first:place]
    mixed[:, place:last] = right[:, place:last]
    mixed[:, place : place + line] = _LINE
