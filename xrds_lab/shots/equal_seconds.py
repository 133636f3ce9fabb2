"""Equal seconds: what the other method has in the seconds of a frame of one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bench import pareto
from .frames import REACH
from .methods import DEFAULT, MEDIAN, NL_MEANS, XRDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Point = dict[str, Any]

_METHODS = {XRDS: REACH, DEFAULT: 0}
"""The two that are compared, each at its radius."""
_PEERS = (MEDIAN, NL_MEANS)


def entries(points: Iterable[Point]) -> list[dict[str, Any]]:
    """PSNR of XRDS and of Cycles + OIDN at the seconds of each of their timed points.

    `at` is the method whose point it is. The other's PSNR is read from its frontier
    over samples and None outside of that. `gain` is XRDS over Cycles + OIDN, in dB, and
    `flicker` the ratio of theirs. Beside a point of Cycles + OIDN `peers` have their
    PSNR of the same samples: their own work is not counted in the seconds.
    """
    points = list(points)
    timed = [p for p in points if p["seconds_per_frame"]]
    shots = dict.fromkeys((p["scene"], p["motion"]) for p in timed)
    found = []
    for scene, motion in shots:
        here = [p for p in timed if (p["scene"], p["motion"]) == (scene, motion)]
        lines = {
            method: [p for p in here if (p["method"], p["radius"]) == (method, radius)]
            for method, radius in _METHODS.items()
        }
        for method, line in lines.items():
            for p in line:
                seconds = p["seconds_per_frame"]
                both = {x: psnr_at(lines[x], seconds) for x in _METHODS}
                both[method] = p["psnr"]
                flickers = {x: flicker_at(lines[x], seconds) for x in _METHODS}
                flickers[method] = p["flicker"]
                what = {"scene": scene, "motion": motion, "at": method}
                what |= {"samples": p["samples"], "seconds": seconds}
                what |= both | {"gain": _gain(both), "flicker": _ratio(flickers)}
                if method == DEFAULT:
                    what["peers"] = _peers(points, p)
                found.append(what)
    return found


def _peers(points: Sequence[Point], point: Point) -> dict[str, float]:
    case = {name: point[name] for name in ("scene", "motion", "samples")}
    return {
        p["method"]: p["psnr"]
        for p in points
        if p["method"] in _PEERS and case.items() <= p.items()
    }


def psnr_at(points: Sequence[Point], seconds: float) -> float | None:
    """PSNR of the points' frontier, linear in the logarithm of seconds.

    None outside of the points: nothing is extrapolated.
    """
    return _at(points, seconds, "psnr")


def flicker_at(points: Sequence[Point], seconds: float) -> float | None:
    """Flicker of the points' frontier by PSNR, as `psnr_at` reads it."""
    if any(p["flicker"] is None for p in points):
        return None
    return _at(points, seconds, "flicker")


def _at(points: Sequence[Point], seconds: float, measure: str) -> float | None:
    line = pareto.frontier(points, price=lambda p: float(p["seconds_per_frame"]))
    if not line:
        return None
    known = [math.log(p["seconds_per_frame"]) for p in line]
    if not known[0] <= math.log(seconds) <= known[-1]:
        return None
    return float(np.interp(math.log(seconds), known, [p[measure] for p in line]))


def _gain(both: dict[str, float | None]) -> float | None:
    ours, theirs = both[XRDS], both[DEFAULT]
    return None if ours is None or theirs is None else ours - theirs


def _ratio(flickers: dict[str, float | None]) -> float | None:
    ours, theirs = flickers[XRDS], flickers[DEFAULT]
    return ours / theirs if ours is not None and theirs else None
