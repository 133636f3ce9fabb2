"""Where tiles lie, how they are blended, and how much memory one costs.

All lengths are low-resolution pixels unless a name says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array

# Of an overlap, this part at each end counts nothing: what is near a tile's edge has
# not seen its surroundings. The blend happens in the rest.
_BLIND = 0.375


@dataclass(frozen=True)
class Span:
    """The extent of a tile along one axis."""

    start: int
    stop: int
    overlap_before: int
    """Shared with the tile before; 0 at the edge of the picture."""
    overlap_after: int

    @property
    def size(self) -> int:
        return self.stop - self.start

    def moved(self, offset: int) -> Span:
        """Return the span `offset` pixels further on."""
        return replace(self, start=self.start + offset, stop=self.stop + offset)

    def output(self, scale: int, limit: int) -> slice:
        """Return the full-resolution pixels it covers of a picture of `limit`."""
        return slice(self.start * scale, min(self.stop * scale, limit))

    def weights(self, scale: int) -> Array:
        """Return the blend weights of its `size * scale` full-resolution pixels.

        Over all spans of an axis they add up to 1.
        """
        weights = np.ones(self.size * scale, np.float32)
        if self.overlap_before:
            rise = _make_ramp(self.overlap_before * scale)
            weights[: rise.size] = rise
        if self.overlap_after:
            fall = 1.0 - _make_ramp(self.overlap_after * scale)
            weights[-fall.size :] = fall
        return weights


def _make_ramp(length: int) -> Array:
    """Return a smooth step from 0 to 1."""
    x = (np.arange(length) + 0.5) / length
    x = np.clip((x - _BLIND) / (1.0 - 2.0 * _BLIND), 0.0, 1.0)
    return (x * x * (3.0 - 2.0 * x)).astype(np.float32)


@dataclass(frozen=True)
class Tile:
    """A rectangle of the low-resolution picture that the network sees at once."""

    rows: Span
    columns: Span

    def moved(self, rows: int, columns: int) -> Tile:
        """Return the tile that lies so many pixels further down and right."""
        return Tile(self.rows.moved(rows), self.columns.moved(columns))

    def weights(self, scale: int) -> Array:
        """Return blend weights (scale height, scale width)."""
        rows, columns = self.rows.weights(scale), self.columns.weights(scale)
        return rows[:, None] * columns


def tiles(
    low_height: int, low_width: int, tile: tuple[int, int], overlap: int, multiple: int
) -> list[Tile]:
    """Cover a picture with tiles.

    Every origin is a multiple of `multiple`, so that attention windows lie in a tile as
    they do in the whole picture.

    Parameters
    ----------
    low_height, low_width : int
        Size of the picture.
    tile : tuple of int
        Largest height and width of a tile.
    overlap : int
        Least overlap of adjacent tiles.
    multiple : int
        What origins are multiples of.

    Returns
    -------
    tiles : list of Tile
        Row by row.
    """
    rows = _make_spans(low_height, tile[0], overlap, multiple)
    columns = _make_spans(low_width, tile[1], overlap, multiple)
    return [Tile(row, column) for row in rows for column in columns]


def largest(plan: list[Tile]) -> int:
    """Return the low-resolution pixels of the largest tile; 0 without tiles."""
    return max((tile.rows.size * tile.columns.size for tile in plan), default=0)


def _make_spans(length: int, tile: int, overlap: int, multiple: int) -> list[Span]:
    overlap = _round_up(overlap, multiple)
    tile = max(tile // multiple * multiple, 2 * overlap, multiple)  # ramps stay apart
    if length <= tile:
        return [Span(0, length, 0, 0)]
    count = math.ceil((length - overlap) / (tile - overlap))
    step = _round_up(
        math.ceil((length - overlap) / count), multiple
    )  # even, so smaller
    starts = range(0, length - overlap, step)
    return [
        Span(
            start,
            min(start + step + overlap, length),
            overlap if start else 0,
            overlap if start + step + overlap < length else 0,
        )
        for start in starts
    ]


def fit(
    low_height: int, low_width: int, pixels: float, overlap: int, multiple: int
) -> tuple[int, int]:
    """Return the size of tiles for a number of pixels.

    Parameters
    ----------
    low_height, low_width : int
        Size of the picture.
    pixels : float
        Most low-resolution pixels of a tile.
    overlap : int
        Overlap of adjacent tiles.
    multiple : int
        What heights and widths are multiples of.

    Returns
    -------
    height, width : int
        Those of the picture if it is small enough; never less than two overlaps, below
        which tiles cannot be blended.
    """
    least = 2 * _round_up(overlap, multiple)
    square = max(math.isqrt(int(pixels)) // multiple * multiple, least)
    height = min(square, _round_up(low_height, multiple))
    width = max(int(pixels / height) // multiple * multiple, least)
    width = min(width, _round_up(low_width, multiple))
    taller = max(int(pixels / width) // multiple * multiple, height)
    return min(taller, _round_up(low_height, multiple)), width


def _round_up(length: int, multiple: int) -> int:
    return -(-length // multiple) * multiple
