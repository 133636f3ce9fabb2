"""Equal seconds: what the other method has in the seconds of a frame of one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bench import pareto
from .figures import DEFAULT, REACH, XRDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Point = dict[str, Any]

_METHODS = {XRDS: REACH, DEFAULT: 0}
"""The two that are compared, each at its radius."""


def entries(points: Iterable[Point]) -> list[dict[str, Any]]:
    """PSNR of XRDS and of Cycles + OIDN at the seconds of each of their timed points.

    `at` is the method whose point it is. The other's PSNR is read from its frontier
    over samples and None outside of that. `gain` is XRDS over Cycles + OIDN, in dB.
    """
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
                what = {"scene": scene, "motion": motion, "at": method}
                what |= {"samples": p["samples"], "seconds": seconds}
                found.append(what | both | {"gain": _gain(both)})
    return found


def psnr_at(points: Sequence[Point], seconds: float) -> float | None:
    """PSNR of the points' frontier, linear in the logarithm of seconds.

    None outside of the points: nothing is extrapolated.
    """
    line = pareto.frontier(points, price=lambda p: float(p["seconds_per_frame"]))
    if not line:
        return None
    known = [math.log(p["seconds_per_frame"]) for p in line]
    if not known[0] <= math.log(seconds) <= known[-1]:
        return None
    return float(np.interp(math.log(seconds), known, [p["psnr"] for p in line]))


def _gain(both: dict[str, float | None]) -> float | None:
    ours, theirs = both[XRDS], both[DEFAULT]
    return None if ours is None or theirs is None else ours - theirs
