"""Probes: what a frame of the scene at hand takes, from a few small renders of it.

They are renders of one sample each, in the session that the frame is then rendered
with, so that the scene is synced once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from xrds_core.errors import XRDSError

from ..cycles.passes import CyclesPasses
from ..cycles.session import has_denoiser
from ..planning.budget import Costs, Model
from ..planning.request import Machine
from ..planning.settings import DEFAULT_DENOISING, Denoising, Network
from .loading import load_denoiser, load_upscaler

PROBE_PIXELS = 130_000  # of the largest probe
PROBE_RUNS = 2  # of which the least counts: what else the machine does only adds
LONG_PROBE = 0.4  # seconds after which it need not be repeated
TINY = 4  # how much smaller, in width and height, the other probe is
LEAST_GUIDE = 0.4  # of a sample's seconds; 0.43 to 0.84 in the scenes that were timed
DENOISER_RUNS = 3
NETWORK_SIDE = 256  # of the output that a network is tried on, in pixels


def probe(
    passes: CyclesPasses,
    model: Model,
    networks: Sequence[Network],
    start: float,
    machine: Machine | None = None,
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
    denoise = _default_denoiser(passes, scale, machine or Machine(), model)
    sync = max(synced - begun - beauty / scale**2, 0.0)
    spent = time.perf_counter() - start
    return Costs(
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
    passes: CyclesPasses, scale: int, machine: Machine, model: Model
) -> float:
    """Seconds of Blender's default denoiser on the whole frame.

    By our quickest one on 1/`scale` of it, where it is there: it needs no render.
    """
    try:
        ours = load_denoiser("fast", machine)
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
    return fast / model.denoiser_speed[Denoising.XRDS_FAST]


def _cycles_denoiser(passes: CyclesPasses, scale: int) -> float:
    """Seconds that Cycles' denoiser adds to a render of the whole frame."""

    def seconds(size: int) -> float:
        noisy = passes.beauty(size, 1, denoise=False).seconds["beauty"]
        denoised = passes.beauty(size, 1, denoiser=DEFAULT_DENOISING).seconds["beauty"]
        return max(denoised - noisy, 0.0)

    small, tiny = 2 * scale, 2 * scale * TINY
    seconds(tiny)  # the first pays for more, and is thrown away
    return _slope(seconds(small), seconds(tiny), small)


def with_network(
    costs: Costs, network: Network, machine: Machine, passes: CyclesPasses
) -> Costs:
    """The costs with the network's measured speed; its loading is behind us then."""
    begun = time.perf_counter()
    seconds = network_seconds_per_pixel(network, machine)
    pixels = passes.region.width * passes.region.height
    factor = seconds * pixels / max(costs.network[network], 1e-9)
    scaled = {n: s * factor for n, s in costs.network.items()}
    return replace(_after(costs, begun), network=scaled)


def network_seconds_per_pixel(network: Network, machine: Machine) -> float:
    """Seconds per output pixel, of the second of two runs on a small noise picture."""
    import numpy as np

    upscaler = load_upscaler(network, machine)
    _, scale = network
    random = np.random.default_rng(0)
    side = NETWORK_SIDE // scale
    low = random.random((side, side, 3), np.float32)
    full = random.random((NETWORK_SIDE, NETWORK_SIDE, 3), np.float32)
    for _ in range(2):
        begun = time.perf_counter()
        upscaler(low, full, full, guide_samples=1)
        seconds = time.perf_counter() - begun
    return seconds / NETWORK_SIDE**2
