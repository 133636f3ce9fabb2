"""Error against seconds per frame, of shots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..bench.plots import svg_of, two_panels
from .frames import REACH
from .methods import (
    BEST,
    DEFAULT,
    MEDIAN,
    NL_MEANS,
    SAME_PICTURE,
    THRESHOLD,
    XRDS,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    Point = dict[str, Any]

# Colour, line and mark differ each by itself: readable in grey and by the colour-blind.
LINES = {
    (DEFAULT, 0): ("Cycles + OIDN", "#d55e00", "--", "s"),
    (BEST, 0): ("Cycles + OIDN, best mode", "#000000", "-", "o"),
    (THRESHOLD, 0): ("Cycles + OIDN, threshold 0.1", "#d55e00", "", "X"),
    (MEDIAN, 1): ("median of three", "#cc79a7", "-.", "^"),
    (NL_MEANS, 1): ("non-local means", "#999999", ":", "x"),
    (XRDS, 0): ("XRDS, the frame alone", "#e69f00", ":", "P"),
    (XRDS, 1): ("XRDS, radius 1", "#56b4e9", "--", "d"),
    (XRDS, 2): ("XRDS, radius 2", "#009e73", "-.", "v"),
    (XRDS, 4): ("XRDS, radius 4", "#0072b2", "-", "D"),
    (SAME_PICTURE, REACH): ("XRDS, Same Picture, late", "#882255", "", "*"),
}
MEASURES = {"psnr": "PSNR, dB (sRGB)", "flicker": "flicker (sRGB)"}
PERCENTILES = (5, 50, 95)
"""Of the scenes: the bar's beginning, the point, and the bar's end."""


def error_plot(
    points: Sequence[Point], motion: str, resolution: Sequence[int] | None = None
) -> bytes | None:
    """SVG of medians over scenes, with the 5th to 95th percentile of errors.

    A line joins the samples per pixel at which all scenes were measured; None where
    there are none. It goes over the seconds of frames of `resolution`, whole ones with
    None; over the samples where no frame was timed.
    """
    shown = [p for p in points if p["motion"] == motion]
    price = "samples"
    axis = "samples per pixel"
    if any(p["seconds_per_frame"] for p in shown):
        shown = [p for p in shown if p["seconds_per_frame"]]
        price = "seconds_per_frame"
        size = "whole frame"
        if resolution is not None:
            size = "frame of {}x{}".format(*resolution)
        axis = f"seconds of a {size}"
    scenes = {p["scene"] for p in shown}
    title = f"shots, `{motion}`: median of {len(scenes)} scenes"
    figure, panels = two_panels(title, axis, MEASURES)
    drawn = False
    for (method, radius), (name, colour, dash, mark) in LINES.items():
        own = [p for p in shown if (p["method"], p["radius"]) == (method, radius)]
        counts = sorted({p["samples"] for p in own})
        groups = [[p for p in own if p["samples"] == n] for n in counts]
        whole = [g for g in groups if {p["scene"] for p in g} == scenes]
        if not whole:
            continue
        drawn = True
        prices = [np.median([p[price] for p in g]) for g in whole]
        for panel, measure in zip(panels, MEASURES, strict=True):
            low, middle, high = np.transpose(
                [np.percentile([p[measure] for p in g], PERCENTILES) for g in whole]
            )
            style = {"color": colour, "linestyle": dash, "linewidth": 1.4}
            panel.plot(prices, middle, label=name, marker=mark, markersize=4, **style)
            panel.vlines(prices, low, high, color=colour, alpha=0.35, linewidth=1)
    return svg_of(figure, panels, outside=True) if drawn else None
