"""The same picture in how many seconds: what Cycles needs for XRDS's error.

Pure functions of points, as in `pareto`.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from . import pareto

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    Point = dict[str, Any]
    Entry = dict[str, Any]

OURS, EVEN, ADAPTIVE = "XRDS", "OIDN, best mode", "OIDN, adaptive sampling"


def entries(
    scene: str, points: Sequence[Point], unit: float, budgets: Sequence[float]
) -> list[Entry]:
    """For XRDS's best picture within each budget what Cycles at its best needs.

    `seconds` and `samples` are XRDS's, of a whole frame and per pixel of it;
    `rival_seconds` and `rival_samples` what Cycles needs for the same PSNR, None where
    none of its points reaches it; the seconds with adaptive sampling or without, the
    samples without, because nobody counts adaptive ones; `gain` is rival's over own
    seconds, above 1 where XRDS is quicker. A picture worse than Cycles' quickest one is
    set against that.
    """
    groups = pareto.groups(points)
    even = groups.get(EVEN, [])
    rivals = [*even, *groups.get(ADAPTIVE, [])]
    found = []
    for budget in budgets:
        own = pareto.best_within(groups.get(OURS, []), budget * unit)
        if own is None or not rivals:
            continue
        seconds = pareto.seconds_of(own)
        needed = least(rivals, own["psnr"], pareto.seconds_of)
        found.append(
            {
                "scene": scene,
                "budget": budget,
                "label": own["label"],
                "psnr": own["psnr"],
                "seconds": seconds,
                "rival_seconds": needed,
                "gain": None if needed is None else needed / seconds,
                "samples": samples(own),
                "rival_samples": least(even, own["psnr"], samples),
            }
        )
    return found


def least(
    points: Sequence[Point], psnr: float, price: Callable[[Point], float]
) -> float | None:
    """The lowest price at which points reach a PSNR; None where none does.

    Between points PSNR is linear in the logarithm of the price, as in `pareto.at`.
    """
    line = pareto.frontier(points, price=price)
    if line and line[0]["psnr"] >= psnr:
        return price(line[0])
    for low, high in pairwise(line):
        if high["psnr"] >= psnr:
            share = (psnr - low["psnr"]) / (high["psnr"] - low["psnr"])
            return price(low) * math.pow(price(high) / price(low), share)
    return None


def samples(point: Point) -> float:
    """Samples per pixel of the full size; those of guides count as well."""
    settings = point["settings"]
    light = settings["samples"] / settings["scale"] ** 2
    return float(light + settings.get("guide_samples", 0))


def in_order(found: Sequence[Entry]) -> list[Entry]:
    """Where XRDS loses most first; what Cycles never reaches last."""
    return sorted(found, key=lambda e: math.inf if e["gain"] is None else e["gain"])
