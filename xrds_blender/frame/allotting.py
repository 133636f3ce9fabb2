"""Whether a still's samples go where they pay, or evenly as Cycles takes them."""

from __future__ import annotations

from typing import Any

from ..cycles.allotted import sample_allotted
from ..cycles.pass_names import COMBINED, NOISY
from ..cycles.samples import Samples, sample_layer
from ..cycles.settings import has_subsets
from ..planning.plan import Decision
from . import progress
from .job import RenderJob

LEAST_SAMPLES = 8
"""Of fewer, what two quarters show is mostly chance."""


def sample(
    engine: Any, depsgraph: Any, job: RenderJob
) -> tuple[dict[str, Samples], dict[str, float], Decision]:
    """Render at full size without Cycles' denoiser.

    Returns samples by view, seconds by stage, and how they were taken. Raises
    Cancelled when the user stops it.
    """
    reason = _why_even(engine, depsgraph, job)
    if reason:
        noisy, clock = sample_layer(
            engine, depsgraph, samples=job.samples, seed=job.seed
        )
        seconds = {"sync": clock.sync, "beauty": clock.render}
        return noisy, seconds, Decision("samples", "even", reason)
    count = job.samples or depsgraph.scene_eval.cycles.samples
    report = progress.reporter(engine)
    noisy, seconds = sample_allotted(engine, depsgraph, count, job.seed, report)
    reason = "parts whose halves differ once denoised take more, the others fewer"
    return noisy, seconds, Decision("samples", "where they pay", reason)


def _why_even(engine: Any, depsgraph: Any, job: RenderJob) -> str:
    """Why every pixel gets as many samples as the others; empty if it need not."""
    cycles, result = depsgraph.scene_eval.cycles, engine.get_result()
    layer = depsgraph.view_layer_eval
    passes = {item.name for item in result.layers[layer.name].passes}
    own_count = layer.samples and cycles.use_layer_samples != "IGNORE"
    fixed = job.samples is not None
    reasons = {
        "even ones are asked for": "samples" not in job.savings,
        f"fewer than {LEAST_SAMPLES} do not show where more are needed": (
            (job.samples or cycles.samples) < LEAST_SAMPLES
        ),
        "other passes are to be Cycles' own": bool(passes - {COMBINED, NOISY}),
        "the views are to be alike": len(result.views) > 1,
        "a graphics card is slow with small parts": cycles.device != "CPU",
        "the memory is limited": job.memory_limit is not None,
        "Cycles' adaptive sampling is on": not fixed and cycles.use_adaptive_sampling,
        "the file limits its seconds": not fixed and cycles.time_limit > 0.0,
        "this Blender continues no sequence": not has_subsets(depsgraph.scene_eval),
        "the file takes a part of a sequence": (
            not fixed and getattr(cycles, "use_sample_subset", False)
        ),
        "the view layer has a count of its own": not fixed and own_count,
        "a shadow catcher is no mean of samples": any(
            item.object.is_shadow_catcher for item in depsgraph.object_instances
        ),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
