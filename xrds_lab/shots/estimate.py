"""How long a measure of shots will take, told before it begins."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from xrds_core.progress import duration

from ..bench.inputs import open_scene

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..bench.windows import Shot, Window

_SMALLER = 4  # times in width and height
_COUNTS = (1, 9)  # samples: their difference is free of what every render takes


def sentence(units: Mapping[Shot, float]) -> str:
    """How long so many samples of each shot's window will take.

    Renders a small picture of each scene.
    """
    seconds = {shot.name: n * _sample_seconds(shot) for shot, n in units.items()}
    longest = max(seconds, key=lambda name: seconds[name])
    scenes = "" if len(seconds) == 1 else f", {longest} the longest"
    return (
        f"about {duration(sum(seconds.values()))} of rendering{scenes}; Ctrl-C stops "
        "it, the same command goes on"
    )


def _sample_seconds(shot: Shot) -> float:
    """Seconds of one sample of every pixel of a shot's window."""
    from xrds_blender import render

    scene = open_scene(shot.path, _smaller(shot.window))
    scene.render.use_persistent_data = True
    taken = []
    for samples in (1, *_COUNTS):  # the first one loads the scene
        started = time.perf_counter()
        render(scene, plain=True, samples=samples)
        taken.append(time.perf_counter() - started)
    few, many = _COUNTS
    each = max(taken[2] - taken[1], 0.0) / (many - few)
    return each * _SMALLER**2


def _smaller(window: Window) -> Window:
    names = ("frame_width", "frame_height", "x", "y", "width", "height")
    sizes = {name: getattr(window, name) // _SMALLER for name in names}
    for name in ("frame_width", "frame_height", "width", "height"):
        sizes[name] = max(sizes[name], 1)
    return replace(window, **sizes)
