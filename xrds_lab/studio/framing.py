"""Choice of training windows: the parts of a frame with detail."""

from __future__ import annotations

import random
from dataclasses import dataclass

import bpy
import numpy as np

from xrds_core.arrays import Array

GRID = 8  # window origins are multiples of this, so that every scale divides them
PROBE_PERCENT = 12
LEAST_INTEREST = 0.05  # the noise of the probe alone reaches about 0.03


@dataclass(frozen=True)
class Window:
    """A square part of a frame: top-left corner and size in full-resolution pixels."""

    x: int
    y: int
    size: int

    def overlaps(self, other: Window) -> bool:
        """True if the two share pixels."""
        return max(abs(self.x - other.x), abs(self.y - other.y)) < self.size


def set_border(scene: bpy.types.Scene, window: Window | None) -> None:
    """Make the scene render only `window`, cropped; the whole frame if None."""
    render = scene.render
    render.use_border = render.use_crop_to_border = window is not None
    if window is None:
        return
    width, height = render.resolution_x, render.resolution_y
    # Blender truncates border x size: a quarter pixel keeps clear of rounding.
    render.border_min_x = (window.x + 0.25) / width
    render.border_max_x = (window.x + window.size + 0.25) / width
    render.border_min_y = (height - window.y - window.size + 0.25) / height
    render.border_max_y = (height - window.y + 0.25) / height


def interest(radiance: Array, albedo: Array, normal: Array) -> Array:
    """Amount of detail at each pixel of a small, noisy picture (h, w)."""
    luminance = _blurred(radiance.mean(-1, keepdims=True))
    light = np.log(luminance + 0.02 * luminance.mean() + 1e-6)
    parts = ((np.clip(albedo, 0, 1), 1.0), (normal, 0.5), (light, 0.2))
    return sum(weight * _slope(part) for part, weight in parts)


def _slope(picture: Array) -> Array:
    down = np.abs(np.diff(picture, axis=0, append=picture[-1:])).mean(-1)
    across = np.abs(np.diff(picture, axis=1, append=picture[:, -1:])).mean(-1)
    return np.minimum(down + across, 0.5)


def _blurred(picture: Array) -> Array:
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 9


def lit(radiance: Array) -> bool:
    """False for a frame that is black, or black but for a few lamps."""
    luminance = np.minimum(radiance.mean(-1), 20 * np.median(radiance.mean(-1)) + 1e-9)
    mean = float(luminance.mean())
    return mean > 1e-4 and float((luminance > 0.1 * mean).mean()) > 0.4


def choose(
    rng: random.Random,
    frame: tuple[int, int],
    size: int,
    count: int,
    detail: Array,
    luminance: Array,
) -> list[Window]:
    """At most `count` windows of a frame (width, height) that do not overlap.

    `detail` is the interest and `luminance` the brightness of the small picture.
    Most are drawn from the best third of the places, some from the middle.
    """
    width, height = frame
    places = [
        Window(
            rng.randrange(0, width - size + 1, GRID),
            rng.randrange(0, height - size + 1, GRID),
            size,
        )
        for _ in range(60)
    ]
    scores = [_mean(detail, place, width) for place in places]
    bright = [_mean(luminance, place, width) for place in places]
    lit_up = [b > 0.05 * float(np.median(bright)) and b > 1e-4 for b in bright]
    good, fair = np.quantile(scores, (0.7, 0.4))
    chosen: list[Window] = []
    for place, score, seen in zip(places, scores, lit_up, strict=True):
        rich = score >= good or (score >= fair and rng.random() < 0.1)
        wanted = seen and rich and score > LEAST_INTEREST
        if wanted and not any(place.overlaps(other) for other in chosen):
            chosen.append(place)
    return chosen[:count]


def _mean(picture: Array, window: Window, width: int) -> float:
    zoom = picture.shape[1] / width
    x, y, size = (round(v * zoom) for v in (window.x, window.y, window.size))
    return float(picture[y : y + size, x : x + size].mean())
