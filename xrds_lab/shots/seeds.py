"""Points of shots that were rendered with several seeds."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    Point = dict[str, Any]

MEASURES = ("psnr", "relmse", "relmse_trimmed", "flip", "flicker")
_SHOT = ("scene", "motion", "method", "samples", "radius")


def over_seeds(points: Iterable[Point]) -> list[Point]:
    """Means of the measures over seeds: one point of each scene, shot and method.

    `seeds` says of how many. A measure that a seed lacks is None.
    """
    groups: dict[tuple[Any, ...], list[Point]] = {}
    for point in points:
        groups.setdefault(tuple(point[key] for key in _SHOT), []).append(point)
    return [_mean(group) for group in groups.values()]


def _mean(group: list[Point]) -> Point:
    first = {key: value for key, value in group[0].items() if key != "seed"}
    measured = [name for name in MEASURES if name in first]
    values = {name: [point[name] for point in group] for name in measured}
    means = {
        name: None if None in found else statistics.fmean(found)
        for name, found in values.items()
    }
    return first | means | {"seeds": len(group)}
