"""A frame of a shot above scale 1: light and guides, each with its neighbours' samples.

The light is accumulated and denoised at low resolution, the guides at full size; then
the network makes the picture of both, as of a single frame.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.temporal.accumulate import Accumulated, accumulate
from xrds_core.temporal.frame import Frame, Stored, store
from xrds_core.temporal.moving import Movement

from ..cycles.low_samples import LowPlace, LowSamples
from ..cycles.passes import CyclesPasses
from ..cycles.rendered import Beauty, Guides
from ..cycles.view import low_view
from ..frame import progress
from ..frame.enlarging import enlarge
from ..frame.facts import find_facts
from ..frame.guide_cache import GuideName
from ..frame.guides import GuideSource
from ..frame.job import NetworkFailed, Picture, RenderJob, Temporal
from ..frame.memory import peak_memory
from ..planning.plan import Plan
from .finishing import accumulation
from .sampling import Sampled, Sampling, light_of, sampling_of

if TYPE_CHECKING:
    from xrds_core import Upscaler
    from xrds_core.denoising import Denoiser


@dataclass(frozen=True, eq=False)
class View:
    """One view of a frame as the window keeps it.

    `place` is that of the light's pixels. Guides of the same `guide_name` hold each
    other's samples: they are not added up.
    """

    light: Stored
    guides: Stored
    guide_name: GuideName | None
    place: LowPlace
    exposure: float | None
    plan: Plan

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the picture."""
        return self.guides.shape


def sample_enlarged(
    engine: Any, depsgraph: Any, job: RenderJob, place: int | None = None
) -> Sampled:
    """Render light and guides of the frame that the dependency graph is at.

    As `sampling.sample_frame`; the result then holds the guides' data passes.
    """
    how = sampling_of(engine, depsgraph, job, place)
    name = f"of frame {how.number}"
    with CyclesPasses(engine, depsgraph, noisy=True, geometry=how.geometry) as passes:
        facts = find_facts(depsgraph, job)
        chosen = job.plan(facts)
        if not chosen.motion_blur:
            passes.hold_still()
        progress.begin(engine, f"{progress.LOW} {name}", 1)
        light = passes.low_samples(
            job.scale, job.samples, seed=how.own_seed, portion=how.portion(how.count)
        )
        exposure = job.exposure or passes.border_exposure()
        progress.begin(engine, f"{progress.GUIDES} {name}", 2)
        portion = how.portion(chosen.guide_samples, other=1)
        wanted = _guide_job(job, how, chosen.guide_samples)
        source = GuideSource(
            passes, depsgraph, wanted, chosen, facts, engine.report, portion
        )
        noisy = {
            view: low.place.beauty(low.samples.picture) for view, low in light.items()
        }
        guides = source.guides(noisy)
        seen = replace(chosen, decisions=(*chosen.decisions, source.decision))
        views = {
            view: View(
                _stored_light(how, job, low, view),
                _stored_guides(how, guides[view], passes, view, chosen),
                source.name,
                low.place,
                exposure,
                seen,
            )
            for view, low in light.items()
        }
    return Sampled(views, _seconds(light, guides))


def _guide_job(job: RenderJob, how: Sampling, samples: int) -> RenderJob:
    """Under a camera that stands still guides are kept until they are as many."""
    if how.place is None:
        return replace(job, seed=how.own_seed)
    enough = samples * (2 * how.radius + 1)
    return replace(job, guide_limit=max(job.guide_limit, enough))


def _stored_light(how: Sampling, job: RenderJob, low: LowSamples, view: str) -> Stored:
    window = low.place.window.x, low.place.window.y
    camera = low_view(how.cameras[view], job.scale, window)
    return store(light_of(how, camera, low.samples), np.float16)


def _stored_guides(
    how: Sampling, guides: Guides, passes: CyclesPasses, view: str, chosen: Plan
) -> Stored:
    if chosen.render_guides:
        depth, vector = passes.geometry(view)
    else:  # an even background
        depth, vector = np.full(guides.alpha.shape, np.inf, np.float32), None
    frame = Frame(
        number=how.number,
        camera=how.cameras[view],
        radiance=None,
        alpha=guides.alpha,
        albedo=guides.albedo,
        normal=guides.normal,
        depth=depth,
        vector=vector,
        samples=guides.samples or chosen.guide_samples or 1,
        still=how.still,
    )
    return store(frame, np.float16)


def _seconds(
    light: dict[str, LowSamples], guides: dict[str, Guides]
) -> dict[str, float]:
    seconds = dict.fromkeys(progress.STAGES, 0.0)
    first = next(iter(light))
    for rendered in (light[first].place, guides[first]):
        for stage, value in rendered.seconds.items():
            seconds[stage] += value
    return seconds


def finish_enlarged(
    own: View,
    lenders: Sequence[View],
    job: RenderJob,
    denoiser: Denoiser,
    upscaler: Upscaler,
    movement: Movement,
    report: Callable[[float], bool] | None = None,
) -> Picture:
    """The picture of a view.

    Its seconds are of accumulation, denoising and network alone. Raises Cancelled where
    `report` says so, and what the network raises.
    """
    started = time.perf_counter()
    gathered = accumulate(own.light, [each.light for each in lenders], movement)
    guides = _gathered_guides(own, lenders, movement)
    accumulated = time.perf_counter()
    beauty = _denoised(own, gathered, denoiser)
    denoised = time.perf_counter()
    try:
        picture = enlarge(
            beauty,
            guides,
            job,
            upscaler,
            exposure=own.exposure,
            skip_idle=own.plan.skip_idle,
            progress=report,
        )
    except NetworkFailed as error:
        error.number = own.light.number
        raise
    seconds = {
        "accumulate": accumulated - started,
        "denoise": denoised - accumulated,
        "network": time.perf_counter() - denoised,
    }
    temporal = Temporal(
        job.temporal_radius,
        gathered.frames,
        float(gathered.samples.mean()),
        gathered.rejected,
    )
    return Picture(
        radiance=np.ascontiguousarray(picture[..., :3]),
        alpha=np.ascontiguousarray(picture[..., 3]),
        albedo=guides.albedo,
        normal=guides.normal,
        low_resolution=beauty.radiance,
        seconds=seconds,
        plan=(*own.plan.decisions, accumulation(gathered.frames)),
        peak_memory=peak_memory(),
        device=str(upscaler.device),
        temporal=temporal,
    )


def _denoised(own: View, gathered: Accumulated, denoiser: Denoiser) -> Beauty:
    assert gathered.radiance is not None
    picture = np.dstack((gathered.radiance, gathered.alpha))
    if not own.plan.denoise:
        return own.place.beauty(picture)
    denoised = denoiser(picture, gathered.albedo, gathered.normal)
    return own.place.beauty(denoised.radiance, gathered.radiance)


def _gathered_guides(own: View, lenders: Sequence[View], movement: Movement) -> Guides:
    """Guides with the samples of other frames; the richest of those of one name."""
    target, others = own.guides, list(lenders)
    if own.guide_name is not None:
        same = [own, *(x for x in lenders if own.guide_name.is_same(x.guide_name))]
        target = max((each.guides for each in same), key=lambda each: each.samples)
        others = [each for each in lenders if each not in same]
    found = accumulate(target, [each.guides for each in others], movement)
    assert found.alpha is not None
    samples = max(1, int(found.samples.mean()))
    return Guides(found.albedo, found.normal, found.alpha, None, None, samples)
