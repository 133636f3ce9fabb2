"""Draws the figure of README.md: errors and flicker of shots over seconds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.files import replacing

from ..shots.frames import REACH
from ..shots.methods import (
    CYCLES,
    DEFAULT,
    MEDIAN,
    NL_MEANS,
    SAME_PICTURE,
    THRESHOLD,
    XRDS,
)
from ..shots.plot import error_plot
from .results import longest, of_cycles, only

if TYPE_CHECKING:
    from pathlib import Path

    from .results import Results, Rows

MOTION = "pan"


def draw(results: Results, path: Path) -> None:
    """Write the figure as SVG: of XRDS the frame alone and the usual radius.

    Raises ValueError where there are no shots.
    """
    points = [
        x
        for x in only(results.shots["shots"], motion=MOTION)
        if x["method"] != XRDS or x["radius"] in (0, REACH)
    ]
    cycles = {(x["scene"], x["samples"]): x for x in only(points, method=DEFAULT)}
    shown = [_priced(x, cycles) for x in points]
    shown += _sooner(results.same_picture, points)
    shown += _adaptive(results.same_picture, points)
    size = results.shots["settings"]["seconds_resolution"]
    svg = error_plot(shown, MOTION, size)
    if svg is None:
        raise ValueError(f"no shots of the motion {MOTION}")
    with replacing(path) as part:
        part.write_bytes(svg)


def _priced(point: dict[str, Any], cycles: dict[Any, Any]) -> dict[str, Any]:
    """A point with the seconds of Cycles' frames where it is made of these.

    What the median and the non-local means take themselves is not counted.
    """
    if point["method"] not in (MEDIAN, NL_MEANS):
        return point
    own = cycles[point["scene"], point["samples"]]
    return point | {"seconds_per_frame": own["seconds_per_frame"]}


def _sooner(rows: Rows, points: Rows) -> Rows:
    """Late frames of *Same Picture* beside the points of Cycles + OIDN.

    They take the seconds of a shot's frame of their samples. They were judged in other
    windows: differences and ratios are taken over, those of the longest pictures.
    """
    found = []
    ours = only(rows, method=SAME_PICTURE, motion=MOTION, noise_threshold=None)
    for own in longest(ours):
        here = only(points, scene=own["scene"])
        shot = only(here, method=XRDS, radius=REACH)
        timed = sorted(
            (x["samples"], x["seconds_per_frame"])
            for x in shot
            if x["seconds_per_frame"]
        )
        usual = only(here, method=DEFAULT, samples=own["samples"])
        if not (timed and usual):
            continue
        taken = own["late_share"] * own["samples"]
        seconds = float(np.interp(taken, *zip(*timed, strict=True)))
        found.append(_same(own, of_cycles(rows, own), usual[0], seconds))
    return found


def _adaptive(rows: Rows, points: Rows) -> Rows:
    """Cycles + OIDN and *Same Picture* with a noise threshold, beside the points.

    Where the same windows were rendered without one, with the samples that take Cycles
    about as long: errors and seconds relate to those of Cycles + OIDN as they do there.
    """
    found = []
    for own in only(rows, method=SAME_PICTURE, motion=MOTION):
        place = {name: own[name] for name in ("scene", "motion", "frames", "size")}
        even = only(rows, method=CYCLES, noise_threshold=None, **place)
        if own["noise_threshold"] is None or not even:
            continue
        cycles = of_cycles(rows, own)
        asked = cycles["processor_seconds"]
        near = min(even, key=lambda x: abs(math.log(x["processor_seconds"] / asked)))
        usual = only(
            points, scene=own["scene"], method=DEFAULT, samples=near["samples"]
        )
        if not (usual and usual[0]["seconds_per_frame"]):
            continue
        seconds = usual[0]["seconds_per_frame"]
        seconds *= asked / near["processor_seconds"]
        there = usual[0] | {
            "method": THRESHOLD,
            "samples": own["samples"],
            "seconds_per_frame": seconds,
            "psnr": usual[0]["psnr"] + cycles["psnr"] - near["psnr"],
            "flicker": usual[0]["flicker"] * cycles["flicker"] / near["flicker"],
        }
        found += [there, _same(own, cycles, there, seconds * own["late_ratio"])]
    return found


def _same(
    own: dict[str, Any], cycles: dict[str, Any], beside: dict[str, Any], seconds: float
) -> dict[str, Any]:
    """*Same Picture* beside a point of Cycles + OIDN."""
    return beside | {
        "method": SAME_PICTURE,
        "radius": REACH,
        "seconds_per_frame": seconds,
        "psnr": beside["psnr"] + own["gain"],
        "flicker": beside["flicker"] * own["flicker"] / cycles["flicker"],
    }
