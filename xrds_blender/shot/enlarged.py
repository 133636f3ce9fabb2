"""The samples of a frame of a shot above scale 1: light at low resolution, and guides.

`enlarged_finishing` makes the picture of them and of their neighbours'.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from xrds_core.errors import Cancelled
from xrds_core.temporal.frame import Camera, Frame, Stored, store

from ..cycles.low_samples import LowPlace, LowSamples
from ..cycles.pass_names import COMBINED, is_light
from ..cycles.passes import CyclesPasses
from ..cycles.rendered import Guides
from ..cycles.view import low_view
from ..frame import progress
from ..frame.facts import find_facts
from ..frame.guide_cache import GuideName
from ..frame.guides import GuideSource
from ..frame.job import RenderJob
from ..frame.stopping import keep_low_samples
from ..planning.plan import GUIDE_CACHE, Decision, Facts, Plan
from ..scene.facts import shapes_move
from .sampling import Sampled, Sampling, light_of, sampling_of

_OF_OTHERS = Decision(
    "guides", "of the frames beside", "only the camera moves: they show the same"
)
_NOT_KEPT = Decision(
    GUIDE_CACHE, "off", "the camera moves: no frame has the guides of another"
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
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    with CyclesPasses(engine, depsgraph, noisy=True, geometry=how.geometry) as passes:
        facts = find_facts(depsgraph, job)
        chosen = job.plan(facts)
        if not chosen.motion_blur:
            passes.hold_still()
        renders = _Renders(engine, depsgraph, job, how, passes, facts, chosen)
        light: dict[str, LowSamples] = {}
        try:
            light = renders.light()
            views = renders.views(light)
            if between and renders.is_told_by_others():
                return Sampled(_with_decision(views, _OF_OTHERS), _seconds(light))
            return renders.with_guides(views, light)
        except Cancelled:
            light = light or passes.stopped_samples(job.scale)
            keep_low_samples(engine, layer_name, job, light)
            raise


@dataclass(frozen=True)
class _Renders:
    """Both Cycles renders of one frame."""

    engine: Any
    depsgraph: Any
    job: RenderJob
    how: Sampling
    passes: CyclesPasses
    facts: Facts
    chosen: Plan

    def light(self) -> dict[str, LowSamples]:
        """The noisy low-resolution light by view."""
        self._begin(progress.LOW, 1)
        how, job = self.how, self.job
        portion = how.portion(how.count)
        return self.passes.low_samples(
            job.scale, job.samples, seed=how.own_seed, portion=portion
        )

    def views(self, light: dict[str, LowSamples]) -> dict[str, View]:
        """The views without guides."""
        exposure = self.job.exposure or self.passes.border_exposure()
        region = self.passes.region
        return {
            view: View(
                light=_stored_light(self.how, self.job, low, view),
                guides=None,
                camera=self.how.cameras[view],
                shape=(region.height, region.width),
                guide_name=None,
                place=low.place,
                exposure=exposure,
                plan=self.chosen,
            )
            for view, low in light.items()
        }

    def is_told_by_others(self) -> bool:
        """Whether guides of the frames beside this one show what its own would show."""
        if _OF_OTHERS.decision not in self.job.savings or not self.chosen.render_guides:
            return False
        spare = {name for _, name in self.engine.spare_passes}
        asked = set(self.passes.pass_names()) - spare - {COMBINED}
        if not all(is_light(name) for name in asked):
            return False  # they come with the guides
        # under a camera that stands still guides are not rendered again anyway
        return self.how.place is None and not shapes_move(self.depsgraph)

    def with_guides(
        self, views: dict[str, View], light: dict[str, LowSamples]
    ) -> Sampled:
        """The views with guides, rendered or kept from a frame before."""
        self._begin(progress.GUIDES, 2)
        samples = self.chosen.guide_samples
        source = GuideSource(
            self.passes,
            self.depsgraph,
            _guide_job(self.job, self.how, samples),
            self.chosen,
            self.facts,
            self.engine.report,
            self.how.portion(samples, other=1),
        )
        noisy = {v: low.place.beauty(low.samples.picture) for v, low in light.items()}
        guides = source.guides(noisy)
        found = {
            view: replace(
                each, guides=self._stored(guides[view], view), guide_name=source.name
            )
            for view, each in views.items()
        }
        is_kept = self.how.place is not None or self.job.guide_cache is not None
        decision = source.decision if is_kept else _NOT_KEPT
        return Sampled(_with_decision(found, decision), _seconds(light, guides))

    def _stored(self, guides: Guides, view: str) -> Stored:
        if self.chosen.render_guides:
            depth, vector = self.passes.geometry(view)
        else:  # an even background
            depth, vector = np.full(guides.alpha.shape, np.inf, np.float32), None
        frame = Frame(
            number=self.how.number,
            camera=self.how.cameras[view],
            radiance=None,
            alpha=guides.alpha,
            albedo=guides.albedo,
            normal=guides.normal,
            depth=depth,
            vector=vector,
            samples=guides.samples or self.chosen.guide_samples or 1,
            still=self.how.still,
        )
        return store(frame, np.float16)

    def _begin(self, stage: str, number: int) -> None:
        progress.begin(self.engine, f"{stage} of frame {self.how.number}", number)


def _with_decision(views: dict[str, View], decision: Decision) -> dict[str, View]:
    """The views with a decision in the place of that of its name."""

    def decided(plan: Plan) -> Plan:
        others = [d for d in plan.decisions if d.decision != decision.decision]
        return replace(plan, decisions=(*others, decision))

    return {name: replace(v, plan=decided(v.plan)) for name, v in views.items()}


def _guide_job(job: RenderJob, how: Sampling, samples: int) -> RenderJob:
    """Under a camera that stands still guides are kept until they are as many.

    Under another no frame finds what one before it has left, so memory is spared.
    """
    if how.place is not None:
        enough = samples * (2 * how.radius + 1)
        return replace(job, guide_limit=max(job.guide_limit, enough))
    kept = job.savings
    if job.guide_cache is None:
        kept = tuple(name for name in kept if name != _NOT_KEPT.decision)
    return replace(job, seed=how.own_seed, savings=kept)


def _stored_light(how: Sampling, job: RenderJob, low: LowSamples, view: str) -> Stored:
    window = low.place.window.x, low.place.window.y
    camera = low_view(how.cameras[view], job.scale, window)
    return store(light_of(how, camera, low.samples), np.float16)


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
