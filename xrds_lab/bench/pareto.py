"""Which method has the least error for its seconds; pure functions of points.

A point is one entry of `points` in results.json: scene, method, settings, seconds
by stage with total, and the error measures.
"""

from __future__ import annotations

import math
import statistics
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import DEFAULT_DENOISING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    Point = dict[str, Any]

# Measures where more is better; of all others less is.
RISING = ("psnr",)
CACHED = "XRDS, guides cached"
STEPS = 96  # of a curve over log seconds
BUDGETS = (0.125, 16.0)  # the first and last of a mean curve


def _oidn_default(point: Point) -> bool:
    return (
        point["method"] == "oidn" and point["settings"]["denoiser"] == DEFAULT_DENOISING
    )


# What is drawn and compared, by name; "XRDS, guides cached" is "XRDS" without theirs.
GROUPS: dict[str, Callable[[Point], bool]] = {
    "Cycles": lambda p: p["method"] == "cycles",
    "OIDN, default": _oidn_default,
    "OIDN, best mode": lambda p: p["method"] == "oidn",
    "OIDN, adaptive sampling": lambda p: p["method"] == "oidn_adaptive",
    "bicubic": lambda p: p["method"] == "bicubic",
    "demodulated bilinear": lambda p: p["method"] == "demodulated_bilinear",
    "XRDS": lambda p: p["method"] in {"xrds", "full_size"},
}


def groups(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Points by group; XRDS also by scale, and with guides for free."""
    members = {name: [p for p in points if has(p)] for name, has in GROUPS.items()}
    ours = members["XRDS"]
    for scale in sorted({p["settings"]["scale"] for p in ours}):
        same = [p for p in ours if p["settings"]["scale"] == scale]
        members[f"XRDS x{scale}"] = same
    members[CACHED] = [
        p if p["method"] == "full_size" else without_guides(p) for p in ours
    ]
    return {name: group for name, group in members.items() if group}


def without_guides(point: Point) -> Point:
    """The point as if its guides had been rendered before."""
    seconds = dict(point["seconds"])
    seconds["total"] -= seconds["guides"]
    return point | {"seconds": seconds | {"guides": 0.0}}


def better(a: Point, b: Point, measure: str = "psnr") -> bool:
    """Whether the first has less error."""
    if measure in RISING:
        return bool(a[measure] > b[measure])
    return bool(a[measure] < b[measure])


def seconds_of(point: Point) -> float:
    """Seconds of a whole frame."""
    return float(point["seconds"]["total"])


def frontier(
    points: Iterable[Point],
    measure: str = "psnr",
    price: Callable[[Point], float] = seconds_of,
) -> list[Point]:
    """Points that no other beats in both price and error, by rising price."""
    line: list[Point] = []
    for point in sorted(points, key=lambda p: (price(p), -p["psnr"])):
        if not line or better(point, line[-1], measure):
            line.append(point)
    return line


def best_within(points: Iterable[Point], seconds: float) -> Point | None:
    """The least error of those that take no longer; None if there is none."""
    inside = frontier(p for p in points if p["seconds"]["total"] <= seconds)
    return inside[-1] if inside else None


def at(points: Sequence[Point], seconds: float, measure: str = "psnr") -> float | None:
    """The frontier's error at `seconds`, between its points linear in log seconds.

    None before its first point; beyond its last, that one's.
    """
    line = frontier(points, measure)
    if not line or seconds < line[0]["seconds"]["total"] * (1 - 1e-9):
        return None
    for low, high in pairwise(line):
        start, end = low["seconds"]["total"], high["seconds"]["total"]
        if seconds < end:
            share = math.log(seconds / start) / math.log(end / start)
            return float(
                low[measure] + max(share, 0.0) * (high[measure] - low[measure])
            )
    return float(line[-1][measure])


def crossings(
    ours: Sequence[Point], rivals: Sequence[Point]
) -> list[dict[str, float | bool]]:
    """Where the frontier with the higher PSNR changes: seconds, and which one leads.

    The first entry is where both exist for the first time.
    """
    if not ours or not rivals:
        return []
    totals = [p["seconds"]["total"] for p in [*ours, *rivals]]
    changes: list[dict[str, float | bool]] = []
    for seconds in spaced(min(totals), max(totals)):
        a, b = at(ours, seconds), at(rivals, seconds)
        if a is None and b is None:
            continue
        wins = b is None or (a is not None and a > b)
        if not changes or changes[-1]["ours_better"] != wins:
            changes.append({"seconds": seconds, "ours_better": wins})
    return changes


def spaced(first: float, last: float) -> list[float]:
    """STEPS values from `first` to `last` in equal ratios."""
    ratio = last / first
    return [first * ratio ** (i / (STEPS - 1)) for i in range(STEPS)]


def mean_curve(
    scenes: dict[str, tuple[Sequence[Point], float]],
    measure: str = "psnr",
) -> list[tuple[float, float]]:
    """(budget, mean error) over scenes of (points, seconds of 1 spp + OIDN).

    Only budgets at which every scene has a point.
    """
    curve = []
    for budget in spaced(*BUDGETS):
        errors = [
            at(points, budget * unit, measure) for points, unit in scenes.values()
        ]
        known = [error for error in errors if error is not None]
        if known and len(known) == len(errors):
            curve.append((budget, statistics.fmean(known)))
    return curve


def dearest_stage(point: Point) -> str:
    """The stage that takes most of a point's seconds."""
    stages = {k: s for k, s in point["seconds"].items() if k != "total"}
    return max(stages, key=stages.__getitem__)
