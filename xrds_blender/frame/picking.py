"""Probes of the scene at hand, and the job that keeps to a time budget.

The probes are small renders of one sample each, in the session that the frame is then
rendered with, so that the scene is synced once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from xrds_core.errors import XRDSError

from ..cycles.passes import CyclesPasses
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
from .denoisers import load_denoiser
from .job import RenderJob
from .networks import known_networks, load_upscaler

PROBE_PIXELS = 130_000  # of the largest probe
PROBE_RUNS = 2  # of which the least counts: what else the machine does only adds
LONG_PROBE = 0.4  # seconds after which it need not be repeated
TINY = 4  # how much smaller, in width and height, the other probe is
LEAST_GUIDE = 0.4  # of a sample's seconds; 0.43 to 0.84 in the scenes that were timed
DENOISER_RUNS = 3
NETWORK_SIDE = 256  # of the output that a network is tried on, in pixels


@dataclass(frozen=True)
class Pick:
    """What a time budget or a quality became, and why.

    `denoise_in_time` gives the quality of our denoiser once the samples are there, by
    the seconds that are left then; None where nothing is left to choose.
    """

    job: RenderJob
    decision: Decision
    denoise_in_time: Callable[[], str] | None = None


def pick(
    passes: CyclesPasses, job: RenderJob, start: float, *, shot: bool = False
) -> Pick:
    """The job for the seconds or the quality asked for.

    `start` is the perf_counter reading from which the budget counts; what has passed
    since then and what the probes take is part of it. Where the job is for all frames
    of a `shot`, which lend each other their samples, the budget is what a frame takes
    on the mean, and the probes come on top once.
    """
    model = budget.shipped()
    errors = model.errors.limited(_denoisers())
    networks = [n for n in known_networks(job) if n in model.network_speed]
    if shot:
        errors = errors.in_shot(job.temporal_radius)

    def choose() -> Picked:
        known = costs.in_shot(job.temporal_radius) if shot else costs
        return _choose(job, known, errors, networks)

    costs = probe(passes, model, networks, start, job)
    picked = choose()
    if picked.choice.scale > 1:  # guides and network were guesses so far
        costs = with_guides(costs, passes)
        picked = choose()
    if picked.choice.scale > 1:  # the other networks are slower by as much
        costs = _with_network(costs, picked.choice.network, job, passes)
        picked = choose()
    goal = job.time_budget or job.quality
    assert goal is not None
    found = Pick(_job(job, picked), picked.decision(goal, job.time_budget is not None))
    choice, seconds = picked.choice, job.time_budget
    is_ours = choice.scale == 1 and choice.denoiser.is_ours
    if seconds is None or shot or not is_ours or not picked.fits:  # or late by intent
        return found

    def denoise_in_time() -> str:
        spent = time.perf_counter() - start
        mode = budget.denoiser_in_time(spent, seconds, choice, costs, errors)
        return mode.quality

    return replace(found, denoise_in_time=denoise_in_time)


def foresee(scene: Any, job: RenderJob, networks: Sequence[Network]) -> Picked | None:
    """What will about be picked, by the scene's last renders; None without any.

    `networks` are those whose weights are there.
    """
    costs = history.costs(scene)
    if costs is None:
        return None
    known = [n for n in networks if n in costs.network]
    errors = budget.shipped().errors.limited(_denoisers())
    return _choose(job, costs, errors, known)


def report_pick(engine: Any, picked: Pick) -> None:
    """Tell in Blender's log and reports what was chosen, and why."""
    decision = picked.decision
    engine.report({"INFO"}, f"XRDS: {decision.value}: {decision.reason}")


def _denoisers() -> tuple[Denoiser, ...]:
    """Those to choose from: ours, or Cycles' where ours is missing.

    Ours has every network of Cycles' and is no slower. Raises XRDSError where nothing
    can denoise: every expected error is of a denoised picture.
    """
    if denoisers.is_there():
        return OUR_DENOISERS
    if has_denoiser():
        return CYCLES_DENOISERS
    raise XRDSError(
        "neither this Blender nor its Python has Open Image Denoise, without which "
        "nothing is known of a picture's quality: install XRDS from its zip, or "
        "choose the settings yourself in place of a time budget or a quality"
    )


def _choose(
    job: RenderJob,
    costs: Costs,
    errors: budget.ErrorModel,
    networks: Sequence[Network],
) -> Picked:
    if job.time_budget is not None:
        return budget.choose(job.time_budget, costs, errors, networks)
    assert job.quality is not None
    return budget.reach(job.quality, costs, errors, networks)


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
            "guide_samples": choice.guide_samples,
        }
    return replace(job, time_budget=None, quality=None, **chosen)


def probe(
    passes: CyclesPasses,
    model: budget.Model,
    networks: Sequence[Network],
    start: float,
    job: RenderJob | None = None,
) -> Costs:
    """Costs of the scene's frame; guides are guessed low, networks from the denoiser's.

    So what is chosen by them without super-resolution, is chosen by the true ones, too:
    `with_guides` is for the rest.
    """
    pixels = passes.region.width * passes.region.height
    scale = _probe_scale(pixels)
    begun = time.perf_counter()
    passes.beauty(scale, 1, denoise=False)  # the first syncs the scene, as any render
    synced = time.perf_counter()
    beauty = _sample_seconds(passes, scale)
    denoise = _default_denoiser(passes, scale, job or RenderJob(), model)
    sync = max(synced - begun - beauty / scale**2, 0.0)
    spent = time.perf_counter() - start
    return budget.Costs(
        fixed=spent + model.other_per_megapixel * pixels / 1e6,
        probes=spent - sync,
        beauty=beauty,
        guide=LEAST_GUIDE * beauty,
        denoise={mode: denoise * x for mode, x in model.denoiser_speed.items()},
        network={n: denoise * model.network_speed[n] for n in networks},
    )


def _sample_seconds(passes: CyclesPasses, scale: int) -> float:
    """Seconds of a sample of the whole frame, from pictures of 1/`scale` and less.

    What a render costs whatever its size, a tenth of a quick scene's probe, would be
    `scale` squared times as much in the whole frame: so it is the slope between two
    sizes.
    """

    def seconds(size: int) -> float:
        runs: list[float] = []
        while len(runs) < PROBE_RUNS and sum(runs) < LONG_PROBE:
            runs.append(passes.beauty(size, 1, denoise=False).seconds["beauty"])
        return min(runs)

    small, tiny = seconds(scale), seconds(TINY * scale)
    # Of frames of a few pixels both take the same, but no sample is for nothing.
    return max(_slope(small, tiny, scale), small * scale**2 / TINY**2)


def _slope(small: float, tiny: float, scale: int) -> float:
    """Seconds of the whole frame, from those at 1/`scale` and TINY times less."""
    return max(small - tiny, 0.0) * scale**2 / (1 - 1 / TINY**2)


def with_guides(costs: Costs, passes: CyclesPasses) -> Costs:
    """The costs with what a sample of guides takes in truth."""
    begun = time.perf_counter()
    scale = _probe_scale(passes.region.width * passes.region.height)
    guide = passes.time_guides(scale, 1)["guides"] * scale**2
    return replace(_after(costs, begun), guide=guide)


def _after(costs: Costs, begun: float) -> Costs:
    """The costs with the seconds since `begun`, which went into one more probe."""
    spent = time.perf_counter() - begun
    return replace(costs, fixed=costs.fixed + spent, probes=costs.probes + spent)


def _probe_scale(pixels: int) -> int:
    return max(1, round(math.sqrt(pixels / PROBE_PIXELS)))


def _default_denoiser(
    passes: CyclesPasses, scale: int, job: RenderJob, model: budget.Model
) -> float:
    """Seconds of Blender's default denoiser on the whole frame.

    By our quickest one on 1/`scale` of it, where it is there: it needs no render.
    """
    try:
        ours = load_denoiser(replace(job, denoise="fast"))
    except XRDSError:
        return _cycles_denoiser(passes, scale) if has_denoiser() else 0.0
    import numpy as np

    shape = passes.region.height // scale, passes.region.width // scale, 3
    noise = np.random.default_rng(0).random(shape, np.float32)
    seconds = []
    for _ in range(DENOISER_RUNS):
        begun = time.perf_counter()
        ours(noise, noise, noise)
        seconds.append(time.perf_counter() - begun)
    fast = min(seconds) * scale**2 * len(passes.views)
    return fast / model.denoiser_speed[Denoiser.XRDS_FAST]


def _cycles_denoiser(passes: CyclesPasses, scale: int) -> float:
    """Seconds that Cycles' denoiser adds to a render of the whole frame."""

    def seconds(size: int) -> float:
        noisy = passes.beauty(size, 1, denoise=False).seconds["beauty"]
        denoised = passes.beauty(size, 1, denoiser=DEFAULT_DENOISER).seconds["beauty"]
        return max(denoised - noisy, 0.0)

    small, tiny = 2 * scale, 2 * scale * TINY
    seconds(tiny)  # the first pays for more, and is thrown away
    return _slope(seconds(small), seconds(tiny), small)


def _with_network(
    costs: Costs, network: Network, job: RenderJob, passes: CyclesPasses
) -> Costs:
    """The costs with the network's measured speed; its loading is behind us then."""
    begun = time.perf_counter()
    seconds = network_seconds_per_pixel(network, job)
    pixels = passes.region.width * passes.region.height
    factor = seconds * pixels / max(costs.network[network], 1e-9)
    network = {n: s * factor for n, s in costs.network.items()}
    return replace(_after(costs, begun), network=network)


def network_seconds_per_pixel(network: Network, job: RenderJob) -> float:
    """Seconds per output pixel, of the second of two runs on a small noise picture."""
    import numpy as np

    upscaler = load_upscaler(replace(job, **network._asdict()))
    scale = network.scale
    random = np.random.default_rng(0)
    side = NETWORK_SIDE // scale
    low = random.random((side, side, 3), np.float32)
    full = random.random((NETWORK_SIDE, NETWORK_SIDE, 3), np.float32)
    for _ in range(2):
        begun = time.perf_counter()
        upscaler(low, full, full, guide_samples=1)
        seconds = time.perf_counter() - begun
    return seconds / NETWORK_SIDE**2
