"""What a time budget could have chosen at best, had it known the frame's own speed.

Stages are timed on other days than whole frames, and a machine is not as quick on all
days. So each full-size way is given the seconds that it would have taken beside the
frame that was rendered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    Point = dict[str, Any]
    Pick = dict[str, Any]

FULL_SIZE = "full_size"


def best(pick: Pick | None, points: Sequence[Point]) -> dict[str, Any] | None:
    """Label and PSNR of the best full-size way within the pick's budget.

    `points` are the scene's. The pick itself is among the ways. None where there is no
    pick, where it is none at full size, or no way fits.
    """
    ways = [p for p in points if p["method"] == FULL_SIZE]
    if pick is None or pick["settings"]["method"] != FULL_SIZE or not ways:
        return None
    seconds = _Speed(pick, ways).seconds
    fitting = [p for p in ways if seconds(p) <= pick["budget"]]
    if pick["seconds"]["total"] <= pick["budget"]:
        fitting.append(pick)
    found = max(fitting, key=lambda way: way["psnr"], default=None)
    return found and {"label": found["label"], "psnr": found["psnr"]}


class _Speed:
    """How a frame's stages compare with the same stages as they were timed."""

    def __init__(self, pick: Pick, ways: Sequence[Point]) -> None:
        taken, settings = pick["seconds"], pick["settings"]
        count = settings["samples"]
        nearest = min(ways, key=lambda p: abs(p["settings"]["samples"] - count))
        timed = nearest["seconds"]["beauty"] / nearest["settings"]["samples"]
        self._samples = taken["beauty"] / count / timed
        alike = [
            p["seconds"]["denoise"]
            for p in ways
            if p["settings"]["denoiser"] == settings["denoiser"]
        ]
        self._denoise = taken["denoise"] / alike[0] if alike else 1.0
        self._rest = taken["total"] - taken["beauty"] - taken["denoise"]

    def seconds(self, way: Point) -> float:
        """Seconds of a way's frame at this speed, the probes included."""
        stages = way["seconds"]
        rendered = stages["beauty"] * self._samples
        return float(rendered + stages["denoise"] * self._denoise + self._rest)
