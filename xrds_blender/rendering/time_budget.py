"""A still in a number of seconds: its samples and its denoiser, by small tries.

The tries are renders of one sample each, in the session that the frame is then
rendered with, so that the scene is synced once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..cycles.passes import CyclesPasses
from ..planning import budget
from ..planning.budget import Costs, Model
from ..planning.plan import Decision
from ..planning.request import Machine, Request
from ..planning.settings import Denoising
from .loading import load_denoiser

TRY_PIXELS = 130_000  # of the largest try
TRIES = 2  # of which the least counts: what else the machine does only adds
LONG_TRY = 0.4  # seconds after which it need not be repeated
TINY = 4  # how much smaller, in width and height, the other try is
DENOISER_TRIES = 3


@dataclass(frozen=True)
class Timed:
    """The request of a still with the samples that fit, and why it has these.

    `denoise_in_time` gives the quality of the denoiser once the samples are there, by
    the seconds that are left then.
    """

    request: Request
    decisions: tuple[Decision, ...] = ()
    denoise_in_time: Callable[[], str] | None = None


@contextmanager
def in_time(
    engine: Any, depsgraph: Any, request: Request, start: float
) -> Iterator[Timed]:
    """Choose what fits into the time budget of a request, if it has one.

    Inside the `with` Cycles has the session of the tries, with its scene. `start` is
    the perf_counter reading from which the budget counts; the tries are part of it.
    Raises XRDSError where our denoiser is missing.
    """
    if request.time_budget is None:
        yield Timed(request)
        return
    with CyclesPasses(engine, depsgraph) as passes:
        timed = choose(passes, request, start)
        (decision,) = timed.decisions
        engine.report({"INFO"}, f"XRDS: {decision.value}: {decision.reason}")
        yield timed


def choose(passes: CyclesPasses, request: Request, start: float) -> Timed:
    """Samples and denoiser for the time budget of a request, as `in_time` has them."""
    seconds = request.time_budget
    assert seconds is not None
    model = budget.shipped()
    costs = measure(passes, model, start, request.machine)
    selection = budget.choose(seconds, costs, model.errors)
    settled = request.with_settings(
        samples=selection.samples, denoising=selection.denoising
    )

    def denoise_in_time() -> str:
        spent = time.perf_counter() - start
        return budget.denoiser_in_time(
            spent, seconds, selection, costs, model.errors
        ).quality

    # one that does not fit is late by intent
    return Timed(
        settled,
        (selection.decision(seconds),),
        denoise_in_time if selection.fits else None,
    )


def measure(
    passes: CyclesPasses, model: Model, start: float, machine: Machine
) -> Costs:
    """What a sample of the scene's frame takes, and each of our denoisers."""
    pixels = passes.region.width * passes.region.height
    scale = max(1, round(math.sqrt(pixels / TRY_PIXELS)))
    passes.beauty(scale, 1, denoise=False)  # the first syncs the scene, as any render
    sample = _sample_seconds(passes, scale)
    denoising = _denoising_seconds(passes, scale, machine, model)
    spent = time.perf_counter() - start
    return Costs(
        fixed=spent + model.other_per_megapixel * pixels / 1e6,
        beauty=sample,
        guide=0.0,
        denoise={mode: denoising * x for mode, x in model.denoiser_speed.items()},
        network={},
    )


def _sample_seconds(passes: CyclesPasses, scale: int) -> float:
    """Seconds of a sample of the whole frame, from pictures of 1/`scale` and less.

    What a render costs whatever its size, a tenth of a quick scene's try, would be
    `scale` squared times as much in the whole frame: so it is the slope between two
    sizes.
    """

    def seconds(size: int) -> float:
        runs: list[float] = []
        while len(runs) < TRIES and sum(runs) < LONG_TRY:
            runs.append(passes.beauty(size, 1, denoise=False).seconds["beauty"])
        return min(runs)

    small, tiny = seconds(scale), seconds(TINY * scale)
    # Of frames of a few pixels both take the same, but no sample is for nothing.
    return max(_slope(small, tiny, scale), small * scale**2 / TINY**2)


def _slope(small: float, tiny: float, scale: int) -> float:
    """Seconds of the whole frame, from those at 1/`scale` and TINY times less."""
    return max(small - tiny, 0.0) * scale**2 / (1 - 1 / TINY**2)


def _denoising_seconds(
    passes: CyclesPasses, scale: int, machine: Machine, model: Model
) -> float:
    """Seconds of Blender's default denoiser on the whole frame.

    By our quickest one on 1/`scale` of it: it needs no render.
    """
    ours = load_denoiser("fast", machine)
    shape = passes.region.height // scale, passes.region.width // scale, 3
    noise = np.random.default_rng(0).random(shape, np.float32)
    seconds = []
    for _ in range(DENOISER_TRIES):
        begun = time.perf_counter()
        ours(noise, noise, noise)
        seconds.append(time.perf_counter() - begun)
    fast = min(seconds) * scale**2 * len(passes.views)
    return fast / model.denoiser_speed[Denoising.XRDS_FAST]
