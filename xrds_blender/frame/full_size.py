"""Full size: Cycles' samples, denoised in this process; no network, no torch."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.errors import Cancelled

from ..cycles import session
from ..cycles.samples import sample_layer
from ..planning.plan import Decision
from . import progress
from .denoisers import load_denoiser
from .job import Picture, RenderJob
from .memory import peak_memory
from .stopping import keep_samples

if TYPE_CHECKING:
    from xrds_core.denoising import Denoised


def render_full_size(
    engine: Any,
    depsgraph: Any,
    job: RenderJob,
    denoise_in_time: Callable[[], str] | None = None,
) -> Picture:
    """Render into the engine's result and return the first view's picture.

    `denoise_in_time` gives the quality in the place of the job's, once the samples are
    there. Every pass but Combined is Cycles' own. Raises Cancelled when the user stops
    it, and XRDSError where the denoiser cannot be loaded, before anything is rendered.
    """
    denoiser = load_denoiser(job)
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    progress.begin(engine, progress.SAMPLES, 1, 2)
    try:
        noisy, clock = sample_layer(
            engine, depsgraph, samples=job.samples, seed=job.seed
        )
        foreseen = job.denoise
        if denoise_in_time is not None:
            job = replace(job, denoise=denoise_in_time())
            denoiser = load_denoiser(job)
        progress.begin(engine, progress.DENOISE, 2, 2)
        started = time.perf_counter()
        report = progress.reporter(engine)
        denoised = {
            view: denoiser(each.picture, each.albedo, each.normal, progress=report)
            for view, each in noisy.items()
        }
    except Cancelled:
        keep_samples(engine, layer_name, job)
        raise
    finished = time.perf_counter()
    pictures = {view: each.radiance for view, each in denoised.items()}
    session.write_combined(engine, layer_name, pictures)
    stages = {
        "sync": clock.sync,
        "beauty": clock.render,
        "denoise": finished - started,
        "write": time.perf_counter() - finished,
    }
    first = next(iter(noisy))
    picture = denoised[first].radiance
    return Picture(
        radiance=np.ascontiguousarray(picture[..., :3]),
        alpha=np.ascontiguousarray(picture[..., 3]),
        albedo=noisy[first].albedo,
        normal=noisy[first].normal,
        seconds=dict.fromkeys(progress.STAGES, 0.0) | stages,
        plan=(
            *job.plan().decisions,
            *in_time(foreseen, job.denoise),
            prefilter(denoised[first]),
        ),
        peak_memory=peak_memory(),
        device=denoiser.device,
        job=job,
    )


def in_time(foreseen: str, quality: str) -> tuple[Decision, ...]:
    """Why the denoising is another than a time budget has foreseen."""
    if quality == foreseen:
        return ()
    why = f"by the seconds that were left after the samples; foreseen was {foreseen}"
    return (Decision("denoise in time", quality, why),)


def prefilter(denoised: Denoised) -> Decision:
    """Which guides were denoised before they guided."""
    name = "guide prefilter"
    if denoised.prefiltered:
        guides = " and ".join(denoised.prefiltered)
        return Decision(name, guides, "their own noise would stay in the picture")
    return Decision(name, "none", "the guides are clean, or the quality takes them raw")
