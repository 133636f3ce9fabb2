"""Draws the figure of README.md: errors and flicker of shots over seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

from ..shots.frames import REACH
from ..shots.methods import DEFAULT, MEDIAN, NL_MEANS, SAME_PICTURE
from ..shots.plot import error_plot
from .results import only

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
    shown += _sooner(results.same_picture, cycles)
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


def _sooner(rows: Rows, cycles: dict[Any, Any]) -> Rows:
    """Late frames of *Same Picture* beside the points of Cycles + OIDN.

    They were judged in other windows: differences and ratios are taken over, those of
    the largest pictures.
    """
    points = {}
    ours = only(rows, method=SAME_PICTURE, motion=MOTION, noise_threshold=None)
    for own in sorted(ours, key=lambda x: int(x["size"].partition("x")[0])):
        usual = cycles.get((own["scene"], own["samples"]))
        if usual is None or not (own["late_ratio"] and usual["seconds_per_frame"]):
            continue
        same = {x: own[x] for x in ("scene", "samples", "motion", "noise_threshold")}
        (alone,) = only(rows, method="cycles_oidn", size=own["size"], **same)
        points[own["scene"], own["samples"]] = usual | {
            "method": SAME_PICTURE,
            "radius": REACH,
            "seconds_per_frame": usual["seconds_per_frame"] * own["late_ratio"],
            "psnr": usual["psnr"] + own["gain"],
            "flicker": usual["flicker"] * own["flicker"] / alone["flicker"],
        }
    return list(points.values())
