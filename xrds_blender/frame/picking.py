"""Probes of the scene at hand, and the job that keeps to a time budget.

The probes are small renders of one sample each, in the session that the frame is then
rendered with, so that the scene is synced once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from xrds_core.errors import XRDSError

from ..cycles.passes import CyclesPasses
from ..cycles.rendered import InProcess
from ..cycles.session import has_denoiser
from ..planning import budget
from ..planning.budget import Costs, Network, Picked
from ..planning.denoiser import (
    CYCLES_DENOISERS,
    DEFAULT_DENOISER,
    OUR_DENOISERS,
    Denoiser,
)
from ..planning.plan import Decision
from . import denoisers, history
from .denoisers import in_process
from .job import RenderJob
from .networks import known_networks, load_upscaler

PROBE_PIXELS = 130_000  # of the largest probe
NETWORK_SIDE = 256  # of the output that a network is tried on, in pixels


def pick(
    passes: CyclesPasses, job: RenderJob, start: float
) -> tuple[RenderJob, Decision]:
    """The job for the seconds or the quality asked for, and why.

    `start` is the perf_counter reading from which the budget counts; what has passed
    since then and what the probes take is part of it.
    """
    model = budget.shipped()
    model = replace(model, errors=model.errors.limited(_denoisers()))
    networks = [n for n in known_networks(job) if n in model.network_speed]
    costs = probe(passes, model, networks, start, in_process(job))
    picked = _choose(job, costs, model, networks)
    if picked.choice.scale > 1:
        # The network's speed was a guess so far; others are slower by as much.
        costs = _with_network(costs, picked.choice.network, job, passes, start)
        picked = _choose(job, costs, model, networks)
    goal = job.time_budget or job.quality
    assert goal is not None
    return _job(job, picked), picked.decision(goal, job.time_budget is not None)


def foresee(scene: Any, job: RenderJob, networks: Sequence[Network]) -> Picked | None:
    """What will about be picked, by the scene's last renders; None without any.

    `networks` are those whose weights are there.
    """
    costs = history.costs(scene)
    if costs is None:
        return None
    model = budget.shipped()
    model = replace(model, errors=model.errors.limited(_denoisers()))
    known = [n for n in networks if n in costs.network]
    return _choose(job, costs, model, known)


def picked_decisions(
    job: RenderJob, choice: Decision, rest: tuple[Decision, ...]
) -> tuple[Decision, ...]:
    """The decisions of a job that was picked: why it was, and what it then leaves out.

    Of plain Cycles the choice says all.
    """
    return (choice,) if job.plain else (choice, *rest)


def _denoisers() -> tuple[Denoiser, ...]:
    """Those that can denoise here.

    Raises XRDSError where nothing can: every expected error is of a denoised picture.
    """
    ours = OUR_DENOISERS if denoisers.is_there() else ()
    cycles = CYCLES_DENOISERS if has_denoiser() else ()
    if not (ours or cycles):
        raise XRDSError(
            "neither this Blender nor its Python has Open Image Denoise, without which "
            "nothing is known of a picture's quality: install XRDS from its zip, or "
            "choose the settings yourself in place of a time budget or a quality"
        )
    return (*cycles, *ours)


def _choose(
    job: RenderJob, costs: Costs, model: budget.Model, networks: Sequence[Network]
) -> Picked:
    if job.time_budget is not None:
        return budget.choose(job.time_budget, costs, model.errors, networks)
    assert job.quality is not None
    return budget.reach(job.quality, costs, model.errors, networks)


def _job(job: RenderJob, picked: Picked) -> RenderJob:
    choice = picked.choice
    chosen = {"denoiser": choice.denoiser, "samples": choice.samples}
    if choice.scale == 1 and choice.denoiser.is_ours:
        quality = choice.denoiser.quality
        chosen |= {"plain": False, "scale": 1, "denoiser": None, "denoise": quality}
    elif choice.scale == 1:
        chosen |= {"plain": True}
    else:
        chosen |= {
            "plain": False,
            "scale": choice.scale,
            "preset": choice.preset,
            "guides": choice.guides,
            "guide_samples": choice.guide_samples,
        }
    return replace(job, time_budget=None, quality=None, **chosen)


def probe(
    passes: CyclesPasses,
    model: budget.Model,
    networks: Sequence[Network],
    start: float,
    ours: InProcess | None = None,
) -> Costs:
    """Costs of the scene's frame; those of the networks are guessed from OIDN's.

    `ours` denoises where this Blender cannot.

    What a render costs whatever its size (5 ms) is lost in the largest probe, what the
    denoiser does (0.1 s) is not: its seconds are the slope between two sizes.
    """
    pixels = passes.region.width * passes.region.height
    scale = max(1, round(math.sqrt(pixels / PROBE_PIXELS)))
    slope = _slope(passes, scale, None if has_denoiser() else ours)
    whole = scale**2
    beauty = passes.beauty(scale, 1, denoise=False).seconds["beauty"] * whole
    guide = passes.time_guides(scale, 1)["guides"] * whole
    denoise = 0.0
    if has_denoiser():
        denoise = max(slope * whole - beauty, 0.0)
    elif ours is not None:
        speed = model.denoiser_speed[Denoiser.XRDS_HIGH]
        denoise = max(slope * whole - beauty, 0.0) / speed
    megapixels = pixels / 1e6
    return budget.Costs(
        fixed=time.perf_counter() - start + model.other_per_megapixel * megapixels,
        beauty=beauty,
        guide=guide,
        denoise={mode: denoise * x for mode, x in model.denoiser_speed.items()},
        network={n: denoise * model.network_speed[n] for n in networks},
    )


def _slope(passes: CyclesPasses, scale: int, ours: InProcess | None) -> float:
    """Seconds of sampling and denoising a picture of 1/scale of the size.

    By Blender's default denoiser, or by `ours` where it is given.
    """

    def seconds(size: int) -> float:
        spent = passes.beauty(size, 1, denoiser=DEFAULT_DENOISER, in_process=ours)
        return spent.seconds["beauty"] + spent.seconds["denoise"]

    seconds(8 * scale)  # the first pays for more, and is thrown away
    tiny, small = seconds(8 * scale), seconds(2 * scale)
    return (small - tiny) / (1 / 2**2 - 1 / 8**2)


def _with_network(
    costs: Costs, network: Network, job: RenderJob, passes: CyclesPasses, start: float
) -> Costs:
    """The costs with the network's measured speed; its loading is behind us then."""
    begun = time.perf_counter()
    seconds = network_seconds_per_pixel(network, job)
    pixels = passes.region.width * passes.region.height
    factor = seconds * pixels / max(costs.network[network], 1e-9)
    return replace(
        costs,
        fixed=costs.fixed + time.perf_counter() - begun,
        network={n: s * factor for n, s in costs.network.items()},
    )


def network_seconds_per_pixel(network: Network, job: RenderJob) -> float:
    """Seconds per output pixel, of the second of two runs on a small noise picture."""
    import numpy as np

    upscaler = load_upscaler(replace(job, **network._asdict()))
    scale = network.scale
    random = np.random.default_rng(0)
    side = NETWORK_SIDE // scale
    low = random.random((side, side, 3), np.float32)
    full = random.random((NETWORK_SIDE, NETWORK_SIDE, 3), np.float32)
    extra = full if network.guides == "full" else None
    for _ in range(2):
        begun = time.perf_counter()
        upscaler(low, full, full, guide_radiance=extra, guide_samples=1)
        seconds = time.perf_counter() - begun
    return seconds / NETWORK_SIDE**2
