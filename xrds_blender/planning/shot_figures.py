"""What neighbouring frames are worth on the mean: figures that the laboratory measured.

`python -m xrds_lab.pages.shot_figures` writes them from docs/results. Pure functions:
neither Blender nor torch is needed here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from .budget import value_at

FILE = Path(__file__).with_name("shots.json")


@dataclass(frozen=True)
class Points:
    """Measured values over sample counts: linear in log2 of the count, flat outside."""

    counts: tuple[int, ...]
    values: tuple[float, ...]

    @classmethod
    def of(cls, points: Mapping[Any, float]) -> Points:
        """Of counts and values in any order."""
        pairs = sorted((int(count), value) for count, value in points.items())
        return cls(*zip(*pairs, strict=True))

    def at(self, count: float) -> float:
        """The value at a count above 0."""
        return value_at(count, self.counts, self.values)


@dataclass(frozen=True)
class CameraFigures:
    """What was measured under cameras that move, or that stand still, at radius 4.

    Beside the frame alone: `gain` in dB of PSNR, and `flicker` as a ratio, by samples;
    `same_flicker` of *Same Picture* beside Cycles with the file's samples.
    """

    gain: Points
    flicker: Points
    same_flicker: float


@dataclass(frozen=True)
class ShotFigures:
    """All of them; `by_radius` is what a radius gains, over radius 4.

    In *Same Picture* late frames take a `share` of the file's samples, by these, under
    a noise threshold `threshold_share`; a camera that stands still may take less.
    `accumulate`: seconds for each neighbour, over those of our denoiser of quality
    high, and `again`: how often a part of the picture is denoised a second time, which
    small ones are as a whole.
    """

    moving: CameraFigures
    still: CameraFigures
    share: Points
    threshold_share: float
    by_radius: Points
    accumulate: float
    again: float

    def of_camera(self, is_still: bool) -> CameraFigures:
        """Those of a camera that stands still, or of one that moves."""
        return self.still if is_still else self.moving

    def gain(self, samples: float, radius: int, is_still: bool) -> float:
        """Decibels that `radius` frames before and after add to a frame."""
        if not radius:
            return 0.0
        return self.of_camera(is_still).gain.at(samples) * self.by_radius.at(radius)

    def flicker(self, samples: float, radius: int, is_still: bool) -> float:
        """Flicker beside that of frames by themselves, of the same samples."""
        if not radius:
            return 1.0
        taken = 1.0 - self.of_camera(is_still).flicker.at(samples)
        return 1.0 - taken * self.by_radius.at(radius)


@lru_cache(maxsize=1)
def shipped() -> ShotFigures:
    """The figures that come with XRDS."""
    content = json.loads(FILE.read_text("utf-8"))

    def camera(name: str) -> CameraFigures:
        entry = content[name]
        return CameraFigures(
            gain=Points.of(entry["gain"]),
            flicker=Points.of(entry["flicker"]),
            same_flicker=entry["same_flicker"],
        )

    return ShotFigures(
        camera("moving"),
        camera("still"),
        Points.of(content["share"]),
        content["threshold_share"],
        Points.of(content["by_radius"]),
        content["accumulate"],
        content["again"],
    )
