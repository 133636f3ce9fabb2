"""Rectangles of blocks that cover what a frame lacks: each costs a call of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Rectangle = tuple[slice, slice]
"""Rows and columns."""


def rectangles(
    blocks: NDArray[np.bool_], call: float = 0.0, most: int = 4
) -> list[Rectangle]:
    """Return up to `most` rectangles of blocks that cover all that are marked.

    The rectangle that gains most by it is divided in two, as long as that leaves out
    a quarter of it, and more blocks than a `call` costs as much as.
    """
    found = [x for x in (_bounds(blocks),) if x is not None]
    while found and len(found) < most:
        splits = [(_split(blocks, each), each) for each in found]
        (parts, gain), divided = max(splits, key=lambda x: x[0][1])
        if not parts or gain < max(0.25 * _area(divided), call):
            break
        found.remove(divided)
        found += parts
    return found


def _bounds(blocks: NDArray[np.bool_]) -> Rectangle | None:
    rows, columns = (np.flatnonzero(blocks.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _split(blocks: NDArray[np.bool_], area: Rectangle) -> tuple[list[Rectangle], float]:
    """Return the two bounds that cover the least, and how much they leave out."""
    best: list[Rectangle] = []
    gain = 0.0
    for axis in (0, 1):
        for place in range(area[axis].start + 1, area[axis].stop):
            parts = []
            for part in (slice(area[axis].start, place), slice(place, area[axis].stop)):
                cut = (part, area[1]) if axis == 0 else (area[0], part)
                inside = _bounds(blocks[cut])
                if inside is not None:
                    parts.append(_moved(inside, cut))
            left_out = _area(area) - sum(map(_area, parts))
            if len(parts) == 2 and left_out > gain:
                best, gain = parts, left_out
    return best, gain


def _moved(inside: Rectangle, start: Rectangle) -> Rectangle:
    rows, columns = (
        slice(x.start + s.start, x.stop + s.start)
        for x, s in zip(inside, start, strict=True)
    )
    return rows, columns


def _area(rectangle: Rectangle) -> int:
    rows, columns = rectangle
    return int((rows.stop - rows.start) * (columns.stop - columns.start))
