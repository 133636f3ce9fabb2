"""Draws the figure of README.md: errors and flicker of shots over seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.files import replacing

from ..shots.frames import REACH
from ..shots.methods import CYCLES, DEFAULT, MEDIAN, NL_MEANS, SAME_PICTURE, XRDS
from ..shots.plot import error_plot
from .results import largest, only

if TYPE_CHECKING:
    from pathlib import Path

    from .results import Results, Rows

MOTION = "pan"


def draw(results: Results, path: Path) -> None:
    """Write the figure as SVG.

    Raises ValueError where there are no shots.
    """
    points = only(results.shots["shots"], motion=MOTION)
    cycles = {(x["scene"], x["samples"]): x for x in only(points, method=DEFAULT)}
    shown = [_priced(x, cycles) for x in points]
    shown += _sooner(results.same_picture, points)
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
    windows: differences and ratios are taken over, those of the largest pictures.
    """
    found = []
    ours = only(rows, method=SAME_PICTURE, motion=MOTION, noise_threshold=None)
    for own in largest(ours):
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
        same = {x: own[x] for x in ("scene", "samples", "motion", "noise_threshold")}
        (alone,) = only(rows, method=CYCLES, size=own["size"], **same)
        taken = own["late_share"] * own["samples"]
        found.append(
            usual[0]
            | {
                "method": SAME_PICTURE,
                "radius": REACH,
                "seconds_per_frame": float(np.interp(taken, *zip(*timed, strict=True))),
                "psnr": usual[0]["psnr"] + own["gain"],
                "flicker": usual[0]["flicker"] * own["flicker"] / alone["flicker"],
            }
        )
    return found
