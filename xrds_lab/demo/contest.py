"""Renders the demo's shot and still by every way; each gets the same seconds."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.plan import GUIDE_CACHE, savings_but
from xrds_blender.planning.request import Request, render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising
from xrds_blender.rendering.blender_job import call_engine
from xrds_blender.rendering.render import render_scene
from xrds_blender.rendering.sampling import noisy_frame
from xrds_blender.rendering.shot import render_shot

from ..shots.truth import Truth
from .scene import MIDDLE, SHOT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

    from .countdown import Countdown

RADIUS = 4
PAIR = (MIDDLE, MIDDLE + 1)
"""Frames that have a reference: their difference tells what flickers."""
REFERENCE_SAMPLES = (64, 512)  # at least and at most
FRAMES = 30
"""What all ways take beside the reference, in frames of Cycles + OIDN, about."""
_SEEDS = (77, 15_485_940)  # of references: no method shares their noise


@dataclass(frozen=True)
class Way:
    """A way to a picture; `trials` are samples of the renders that tell its seconds."""

    name: str
    label: str
    job: Request
    trials: tuple[int, int] = (1, 4)
    where: str = ""


CYCLES = Way(
    "cycles_oidn_default",
    "Cycles + OIDN",
    render_request(plain=True, denoiser=DEFAULT_DENOISING),
)
QUICK = Way(
    "cycles_oidn_quick",
    "Cycles + OIDN, fast prefilter",
    render_request(plain=True, denoiser=Denoising.HIGH_FAST),
)
FULL_SIZE = Way("xrds_x1", "XRDS, full size", render_request(scale=1))
ENLARGED = Way(
    "xrds_x2",
    "XRDS, super-resolution x2",
    # every picture is to pay for its own guides
    render_request(scale=2, guide_samples=1, savings=savings_but(GUIDE_CACHE)),
    trials=(4, 16),
    where=" at half size",
)
ACCUMULATED = Way(
    "xrds_shot", "XRDS, shot", render_request(scale=1, temporal_radius=RADIUS)
)


@dataclass(frozen=True)
class Entry:
    """What a way made: `frames` are radiance (H, W, 3), scene-linear, by number.

    `seconds` are wall clock, of one frame.
    """

    way: Way
    samples: int
    seconds: float
    frames: dict[int, Array]

    @property
    def label(self) -> str:
        """The way and its samples, to be shown."""
        return f"{self.way.label}, {self.samples} spp{self.way.where}"


@dataclass(frozen=True)
class Reference:
    """What is true of both frames of `PAIR`, and its picture to be shown."""

    picture: Entry
    truth: Truth


def fitting(seconds: float, fixed: float, each: float) -> int:
    """The samples that take nearest to so many seconds, fixed ones included."""
    return max(1, round((seconds - fixed) / each))


class Contest:
    """Renders one scene again and again; every call is timed as the user waits."""

    def __init__(self, scene: Any, countdown: Countdown) -> None:
        ensure_registered()
        self._scene, self._countdown = scene, countdown
        self._lines: dict[Way, tuple[float, float]] = {}

    def warm_up(self, ways: Sequence[Way]) -> None:
        """Load Cycles, OIDN and torch, so that no way pays for being the first."""
        self._countdown.say("loading Cycles, OIDN and PyTorch")
        size = self._scene.render.resolution_percentage
        self._scene.render.resolution_percentage = 10
        for way in ways:
            self._still(way, 4)
        self._scene.render.resolution_percentage = size

    def plain_shot(self, seconds: float) -> Entry:
        """Every frame by itself, by Cycles and OIDN, with the samples that fit."""
        return self._separately(CYCLES, self.samples_in(CYCLES, seconds), SHOT)

    def pair(self, way: Way, seconds: float) -> Entry:
        """The two frames that have a reference, with the samples that fit."""
        return self._separately(way, self.samples_in(way, seconds), PAIR)

    def shot(self, samples: int) -> Entry:
        """The shot as XRDS renders shots."""
        fixed, each = self._line(CYCLES)
        reference = fixed + REFERENCE_SAMPLES[0] * each
        frame = fixed + samples * each
        self._countdown.needs(FRAMES * frame + len(PAIR) * reference)
        taken, made = self._shoot(samples)
        frames = {number: picture.radiance for number, picture in made.items()}
        return Entry(ACCUMULATED, samples, taken / len(SHOT), frames)

    def still(self, way: Way, seconds: float) -> Entry:
        """The middle frame with the samples that fit into `seconds`."""
        samples = self.samples_in(way, seconds)
        self._countdown.say(f"the still: {way.label}, {samples} spp")
        taken, radiance = self._still(way, samples)
        return Entry(way, samples, taken, {MIDDLE: radiance})

    def references(self) -> Reference:
        """Two frames, each rendered twice, with the samples that the time left allows.

        The picture is of the middle frame's samples together, denoised by Cycles' OIDN.
        """
        fixed, each = self._line(CYCLES)
        least, most = REFERENCE_SAMPLES
        samples = fitting(self._countdown.left / len(PAIR), fixed, each)
        samples = max(least, min(most, samples))
        self._countdown.needs(len(PAIR) * (fixed + samples * each))
        half = samples // 2
        started = time.perf_counter()
        one, two = (tuple(self._raw(half, seed, n) for n in PAIR) for seed in _SEEDS)
        seconds = (time.perf_counter() - started) / len(PAIR)
        way = replace(CYCLES, name="reference", label="Reference")
        truth = Truth.of_renders(((one[0], one[1]), (two[0], two[1])))
        picture = Entry(way, 2 * half, seconds, {MIDDLE: truth.clean})
        return Reference(picture, truth)

    def samples_in(self, way: Way, seconds: float) -> int:
        """The samples that fit into so many seconds; one at least."""
        return fitting(seconds, *self._line(way))

    # --- seconds ----------------------------------------------------------------------

    def _line(self, way: Way) -> tuple[float, float]:
        """Seconds of a still without samples, and of one sample."""
        if way not in self._lines:
            self._countdown.say(f"how long a sample takes: {way.label}")
            few, more = way.trials
            # the camera moves between them, as in the shot
            low, high = (
                self._still(way, n, number)[0]
                for n, number in zip(way.trials, PAIR, strict=True)
            )
            each = max(0.01, (high - low) / (more - few))
            self._lines[way] = max(0.0, low - few * each), each
        return self._lines[way]

    # --- renders ----------------------------------------------------------------------

    def _shoot(self, samples: int) -> tuple[float, Any]:
        job, name = ACCUMULATED.job.with_settings(samples=samples), ACCUMULATED.label
        start, made = time.perf_counter(), {}
        self._countdown.say(f"{name}, {samples} spp, {len(SHOT)} frames")
        for number, picture in render_shot(self._scene, job, SHOT):
            made[number] = picture
            self._countdown.say(f"{name}, {samples} spp, frame {number} of {SHOT[-1]}")
        return time.perf_counter() - start, made

    def _separately(self, way: Way, samples: int, numbers: Sequence[int]) -> Entry:
        frames, seconds = {}, 0.0
        for number in numbers:
            self._countdown.say(
                f"{way.label}, {samples} spp, frame {number} of {SHOT[-1]}"
            )
            taken, frames[number] = self._still(way, samples, number)
            seconds += taken
        return Entry(way, samples, seconds / len(numbers), frames)

    def _raw(self, samples: int, seed: int, number: int) -> Frame:
        self._countdown.say(f"the reference, frame {number}, {samples} spp")
        job = replace(ACCUMULATED.job.with_settings(samples=samples), seed=seed)
        self._scene.frame_set(number)
        frames, _ = call_engine(self._scene, lambda *given: noisy_frame(*given, job))
        return next(iter(frames.values()))

    def _still(
        self, way: Way, samples: int, number: int = MIDDLE
    ) -> tuple[float, Array]:
        """Seconds and radiance (H, W, 3) of one frame."""
        job = way.job.with_settings(samples=samples)
        start = time.perf_counter()
        self._scene.frame_set(number)
        radiance = render_scene(self._scene, job).radiance
        seconds = time.perf_counter() - start
        if not np.isfinite(radiance).all():
            raise FloatingPointError(f"{way.label} holds values that are not finite")
        return seconds, radiance
