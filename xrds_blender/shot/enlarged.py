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
from xrds_core.temporal.frame import Camera, Frame, Stored, store
from xrds_core.temporal.moving import Movement
from xrds_core.temporal.stand_in import stand_in
from xrds_core.temporal.takes import same_take

from ..cycles.low_samples import LowPlace, LowSamples
from ..cycles.pass_names import COMBINED, is_light
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
from ..planning.plan import Decision, Plan
from ..scene.facts import shapes_move
from .finishing import accumulation
from .sampling import Sampled, Sampling, light_of, sampling_of

if TYPE_CHECKING:
    from xrds_core import Upscaler
    from xrds_core.denoising import Denoiser


_OF_OTHERS = Decision(
    "guides", "of the frames beside", "only the camera moves: they show the same"
)


@dataclass(frozen=True, eq=False)
class View:
    """One view of a frame as the window keeps it.

    `place` is that of the light's pixels, `camera` sees those of the picture. Guides of
    the same `guide_name` hold each other's samples: they are not added up. None where
    those of the frames beside it show what this one would show.
    """

    light: Stored
    guides: Stored | None
    camera: Camera
    shape: tuple[int, int]
    guide_name: GuideName | None
    place: LowPlace
    exposure: float | None
    plan: Plan


def sample_enlarged(
    engine: Any,
    depsgraph: Any,
    job: RenderJob,
    place: int | None = None,
    between: bool = False,
) -> Sampled:
    """Render light and guides of the frame that the dependency graph is at.

    As `sampling.sample_frame`; the result then holds the guides' data passes. A frame
    `between` two others takes its guides from them where that costs no detail.
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
        shape = passes.region.height, passes.region.width
        asked = _asks_for_guides(engine, passes)
        if between and not asked and _is_told_by_others(depsgraph, job, how, chosen):
            seen = replace(chosen, decisions=(*chosen.decisions, _OF_OTHERS))
            lit = {
                view: _view(how, job, low, view, shape, exposure, seen)
                for view, low in light.items()
            }
            return Sampled(lit, _seconds(light))
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
            view: replace(
                _view(how, job, low, view, shape, exposure, seen),
                guides=_stored_guides(how, guides[view], passes, view, chosen),
                guide_name=source.name,
            )
            for view, low in light.items()
        }
    return Sampled(views, _seconds(light, guides))


def _asks_for_guides(engine: Any, passes: CyclesPasses) -> bool:
    """Whether the file asks for passes that come with the guides."""
    spare = {name for _, name in engine.spare_passes}
    asked = set(passes.pass_names()) - spare - {COMBINED}
    return not all(is_light(name) for name in asked)


def _is_told_by_others(
    depsgraph: Any, job: RenderJob, how: Sampling, chosen: Plan
) -> bool:
    """Whether guides of the frames beside this one show what its own would show."""
    if _OF_OTHERS.decision not in job.savings or not chosen.render_guides:
        return False
    # under a camera that stands still they are not rendered again anyway
    return how.place is None and not shapes_move(depsgraph)


def _view(
    how: Sampling,
    job: RenderJob,
    low: LowSamples,
    view: str,
    shape: tuple[int, int],
    exposure: float | None,
    seen: Plan,
) -> View:
    """A view without guides."""
    return View(
        light=_stored_light(how, job, low, view),
        guides=None,
        camera=how.cameras[view],
        shape=shape,
        guide_name=None,
        place=low.place,
        exposure=exposure,
        plan=seen,
    )


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
    light: dict[str, LowSamples], guides: dict[str, Guides] | None = None
) -> dict[str, float]:
    seconds = dict.fromkeys(progress.STAGES, 0.0)
    first = next(iter(light))
    rendered = [light[first].place.seconds]
    if guides is not None:
        rendered.append(guides[first].seconds)
    for each in rendered:
        for stage, value in each.items():
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
    others = [each for each in lenders if each.guides is not None]
    if own.guide_name is not None:
        name = own.guide_name
        same = [own, *(each for each in others if name.is_same(each.guide_name))]
        own = max(same, key=_samples)
        others = [each for each in others if each not in same]
    lent = [each.guides for each in others if each.guides is not None]
    target = own.guides
    if target is None:
        number = own.light.number
        beside = sorted(lent, key=lambda each: abs(each.number - number))[:2]
        target = stand_in(number, own.camera, beside)
    found = accumulate(target, lent, movement)
    assert found.alpha is not None
    # their own number: where nothing is lent there are no more
    samples = max(1, int(target.samples))
    return Guides(found.albedo, found.normal, found.alpha, None, None, samples)


def lacks_guides(own: View, lenders: Sequence[View]) -> bool:
    """Whether a frame counted on guides of frames that a cut parts from it."""
    if own.guides is not None:
        return False
    rich = [each.light for each in lenders if each.guides is not None]
    return not same_take(own.light, rich)


def _samples(view: View) -> float:
    return 0.0 if view.guides is None else view.guides.samples
