"""Results of checks, and measures of how two pictures differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from xrds_core.arrays import Array


class Measured(NamedTuple):
    """A value of the table of bounds, and the curve that it is the worst of."""

    name: str
    value: float
    curve: dict[float, float] | None = None


def worst(name: str, curve: dict[float, float]) -> Measured:
    """Return the largest value of a curve; NaN counts as infinite."""
    values = [y if y == y else float("inf") for y in curve.values()]  # noqa: PLR0124  # NaN
    return Measured(name, max(values), curve)


def relative_difference(picture: Array, expected: Array) -> float:
    """Return the largest difference, of the expected value, where there is light."""
    lit = expected > expected.max() * 1e-9
    difference = np.abs(picture.astype(np.float64) - expected)[lit] / expected[lit]
    return float(difference.max(initial=0.0))


def smape(picture: Array, expected: Array) -> float:
    """Return the mean of 2 |a - b| / (|a| + |b|), 0 where both are 0."""
    a, b = picture.astype(np.float64), expected.astype(np.float64)
    total = np.abs(a) + np.abs(b)
    return float(np.mean(2 * np.abs(a - b) / np.where(total > 0, total, 1.0)))


def faults(picture: Array) -> int:
    """Return the number of values that are not finite or below zero."""
    return int(picture.size - (np.isfinite(picture) & (picture >= 0)).sum())


def distance(side: int, scale: int, spots: list[tuple[int, int]]) -> Array:
    """Return output pixels' distance from the nearest spot's own footprint.

    `spots` are (row, column) of low-resolution pixels; the distance is the larger of
    both axes, in output pixels, 0 inside the footprint.
    """
    axis = np.arange(side)
    nearest = np.full((side, side), np.inf, np.float32)
    for row, column in spots:
        rows, columns = (
            np.maximum(np.maximum(k * scale - axis, axis - (k + 1) * scale + 1), 0)
            for k in (row, column)
        )
        nearest = np.minimum(nearest, np.maximum(rows[:, None], columns))
    return nearest
