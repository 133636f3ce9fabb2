"""`python -m xrds_lab.pages.shot_figures` writes what the product expects of shots.

Means over docs/results, for the panel and `xrds plan` to say before a first render.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import fmean
from typing import Any

from xrds_blender.planning.shot_figures import FILE

from .results import Results, longest, of_cycles, only

ROOT = Path(__file__).resolve().parents[2]


def figures(root: Path = ROOT) -> dict[str, Any]:
    """Return them as `ShotFigures` reads them."""
    results = Results(root / "docs/results")
    gallery = results.later_gallery
    # flicker is judged in the gallery where the camera stands still
    flicker = [x for x in results.gallery if x["flicker"] is not None]
    stills = {x["shot"] for x in flicker}
    same = longest(only(results.same_picture, method="same_picture", motion="pan"))
    even = [x for x in same if not x["noise_threshold"]]
    noisy = [x for x in same if x["noise_threshold"]]
    locked = results.read("shots/locked-off.json")
    locked_flicker = (
        locked["flicker"]["same_picture"] / locked["flicker"]["cycles_oidn"]
    )
    return {
        "source": (
            "gain: gallery of small shots, 320x180, middle frame of nine beside the "
            "frame alone; flicker: the gallery's under a camera that stands still, "
            "seven scenes under one that pans, along its motion; share: Same Picture, "
            "late frames of a shot under a camera that pans; accumulate: 1080p"
        ),
        "moving": {
            "gain": _means(
                (x for x in gallery if x["shot"] not in stills), lambda x: x["gain"]
            ),
            "flicker": _means(
                (x for n in results.pan_samples for x in results.pans(n)),
                lambda x: x["flicker_ratio"],
            ),
            "same_flicker": _mean(_flicker_ratios(results.same_picture, same)),
        },
        "still": {
            "gain": _means(
                (x for x in gallery if x["shot"] in stills), lambda x: x["gain"]
            ),
            "flicker": _means(flicker, lambda x: x["flicker"]),
            "same_flicker": round(locked_flicker, 3),
        },
        "share": _means(even, lambda x: x["late_share"]),
        "threshold_share": _mean(x["late_share"] for x in noisy),
        "by_radius": {
            str(radius): _mean(
                fmean(x["gain"] for x in results.pans(n, radius=radius))
                / fmean(x["gain"] for x in results.pans(n))
                for n in (2, 16)
            )
            for radius in (1, 2, 4)
        },
        "accumulate": _accumulating(results),
        "again": _mean(x["twice"] > 0.0 for x in gallery),
    }


_NEIGHBOURS = 8


def _means(rows: Iterable[Any], value: Callable[[Any], float]) -> dict[str, float]:
    """Return the mean of a value by samples."""
    by_samples: dict[int, list[float]] = {}
    for row in rows:
        by_samples.setdefault(row["samples"], []).append(value(row))
    return {str(n): _mean(by_samples[n]) for n in sorted(by_samples)}


def _mean(values: Iterable[float]) -> float:
    return round(fmean(values), 3)


def _flicker_ratios(rows: list[Any], ours: list[Any]) -> Iterable[float]:
    """Yield flicker beside that of Cycles + OIDN with the file's samples."""
    for row in ours:
        yield row["flicker"] / of_cycles(rows, row)["flicker"]


def _accumulating(results: Results) -> float:
    """Return seconds for a neighbour over those of a denoising, on two cores."""
    points = only(results.read("own-seconds/own-seconds.json")["points"], cores=2)
    seconds = {
        part: fmean(x["seconds"] for x in only(points, part=part))
        for part in ("accumulate", "denoise")
    }
    return round(seconds["accumulate"] / seconds["denoise"] / _NEIGHBOURS, 4)


def main() -> int:
    """Write the file of the product."""
    FILE.write_text(json.dumps(figures(), indent=1) + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
