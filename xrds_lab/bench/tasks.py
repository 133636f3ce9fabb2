"""What is timed beside Cycles' renders: networks, baselines, frames of the product."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.plan import GUIDE_CACHE, savings_but
from xrds_blender.planning.request import Request as RenderRequest
from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising

from .inputs import Request, open_scene, sample_adaptively
from .rivals import ENLARGEMENTS
from .stages import (
    CYCLES,
    GUIDE_DENOISER,
    PLAIN_FRAME,
    XRDS_FRAME,
    clocked,
    in_process_name,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from xrds_blender.planning.settings import Network
    from xrds_blender.rendering.picture import Picture
    from xrds_core.arrays import Array

    from .inputs import Arrays
    from .pictures import Networks
    from .rivals import Enlargement
    from .stages import Run, Task
    from .sweep import Config
    from .windows import Shot, Window


def tasks(shot: Shot, configs: Iterable[Config], networks: Networks) -> dict[str, Task]:
    """Everything that `Stopwatch` times beside the renders, by name."""
    window = shot.window.whole
    timed: dict[str, Task] = {}
    used: list[Network] = []
    noisy = cache(lambda: _noisy_frame(shot))
    for config in configs:
        if config.noise_threshold is not None:
            if config.denoiser == DEFAULT_DENOISING:  # the others follow from it
                timed[config.label] = _adaptive_frame(shot, config)
            continue
        name = in_process_name(config)
        if config.method in CYCLES or name in timed:
            continue
        if config.method == "full_size":
            timed[name] = _our_denoiser(Denoising(config.denoiser), noisy)
        elif config.method == "xrds":
            used.append(config.network)
            timed[name] = _network(networks, config.network, window)
        else:
            timed[name] = _baseline(ENLARGEMENTS[config.method], window, config.scale)
    timed[PLAIN_FRAME] = lambda: frame(shot, plain_job())[1]
    if used:
        timed[GUIDE_DENOISER] = _guide_denoiser(networks, used[0], window)
        job = _quick_job(networks, used[0])
        timed[XRDS_FRAME] = lambda: frame(shot, job)[1]
    return timed


def plain_job() -> RenderRequest:
    """1 spp + OIDN with Blender's defaults: the unit of all budgets."""
    return render_request(plain=True, samples=1, denoiser=DEFAULT_DENOISING)


def _adaptive_frame(shot: Shot, config: Config) -> Task:
    job = render_request(plain=True, denoiser=Denoising(config.denoiser))
    return lambda: frame(shot, job, config)[1]


def frame(
    shot: Shot, job: RenderRequest, adaptive: Config | None = None
) -> tuple[Picture, Run]:
    """Render a whole frame as a user does, from a freshly opened file.

    Every frame renders its own guides. `other` is the time outside all stages;
    weights are loaded before. `adaptive` tells how Cycles samples adaptively.
    """
    from xrds_blender.interface.registration import ensure_registered
    from xrds_blender.rendering.loading import load_upscaler
    from xrds_blender.rendering.render import render_scene

    ensure_registered()
    scene = open_scene(shot.path, shot.window.whole)
    if adaptive is not None and adaptive.noise_threshold is not None:
        sample_adaptively(scene, adaptive.samples, adaptive.noise_threshold)
    if job.settings.is_enlarged:
        load_upscaler(job.settings.network, job.machine)
    pictures: list[Picture] = []
    job = replace(job, savings=savings_but(GUIDE_CACHE))
    run = clocked(lambda: pictures.append(render_scene(scene, job)))
    stages = {k: s for k, s in pictures[0].seconds.items() if k != "total"}
    other = run["seconds"] - sum(stages.values())
    return pictures[0], run | {"other": other, "sync": stages["sync"]}


def noise(window: Window, scale: int) -> tuple[Array, Array]:
    """Low-resolution picture and guide of the frame's size, in [0, 1)."""
    random = np.random.default_rng(0)
    low = -(-window.frame_height // scale), -(-window.frame_width // scale), 3
    full = low[0] * scale, low[1] * scale, 3
    return random.random(low, np.float32), random.random(full, np.float32)


def _baseline(enlarge: Enlargement, window: Window, scale: int) -> Task:
    def task() -> Run:
        low, full = noise(window, scale)
        return clocked(lambda: enlarge(low, low, full, full, scale))

    return task


def _noisy_frame(shot: Shot) -> Arrays:
    """A whole frame of one sample with its guides: what our denoiser is timed on."""
    from xrds_blender import run_job

    scene = open_scene(shot.path, shot.window.whole)
    return run_job(scene, lambda passes: Request("full", 1).render(passes)[0])


def _our_denoiser(mode: Denoising, noisy: Callable[[], Arrays]) -> Task:
    """Time our denoiser; building its filters, once a session, does not count."""
    from xrds_core.denoising import Denoiser as OurDenoiser

    built: list[OurDenoiser] = []

    def task() -> Run:
        frame = noisy()

        def run() -> Any:
            return built[0](frame["radiance"], frame["albedo"], frame["normal"])

        if not built:
            built.append(OurDenoiser(mode.quality))
            run()
        return clocked(run)

    return task


def _guide_denoiser(networks: Networks, network: Network, window: Window) -> Task:
    """Time the denoising of a whole frame's guides; all networks share it."""
    from xrds_core.superres.guide_noise import remover

    def task() -> Run:
        upscaler, (_, full) = networks[network], noise(window, network.scale)
        quiet = remover(1, upscaler.device.type)
        if quiet is None:
            raise LookupError("Open Image Denoise is missing: install mitsuba-oidn")
        quiet(full, 1 - full)  # the same guides again would be kept
        return clocked(lambda: quiet(full, full))

    return task


def _network(networks: Networks, network: Network, window: Window) -> Task:
    """Time a network; loading counts apart, as `load`, and the first run is dropped."""
    warm: list[bool] = []

    def task() -> Run:
        load = clocked(lambda: networks[network])["seconds"]
        upscaler, (low, full) = networks[network], noise(window, network.scale)

        def run() -> Any:
            return upscaler(low, full, full)

        if not warm:
            warm.append(bool(run()))
        return clocked(run) | {"load": load}

    return task


def _quick_job(networks: Networks, network: Network) -> RenderRequest:
    return render_request(
        **network._asdict(),
        samples=network.scale,
        guide_samples=1,
        device=networks.device,
        weights=networks.weights,
        denoiser=Denoising.HIGH_FAST,
    )
