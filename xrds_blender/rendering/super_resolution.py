"""The paper's method: low-resolution light, full-size guides, and the network.

In a shot light and guides take the samples of neighbour frames before the light is
denoised and enlarged.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.accumulation.accumulate import Accumulated, accumulate, same_shot
from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import reprojected_placeholder
from xrds_core.arrays import Array
from xrds_core.errors import Cancelled

from ..cycles import live
from ..cycles.low_resolution import Beauty, Guides, LowPlace, LowSamples
from ..cycles.passes import CyclesPasses
from ..cycles.settings import COMBINED, is_light
from ..cycles.view import low_view
from ..planning import plan
from ..planning.plan import GUIDE_CACHE, Decision, Facts, Plan
from ..planning.request import Machine, Request
from ..planning.settings import Settings
from ..scene.contents import shapes_move
from . import stages
from .enlarging import enlarge, enlarged, enlarged_lights
from .facts import find_facts
from .full_size import accumulation, temporal
from .guide_cache import GuideName
from .guides import GuideSource
from .loading import in_process, load_denoiser, load_upscaler
from .methods import Method, Report
from .picture import NetworkFailed, Picture, Temporal, peak_memory
from .sampling import (
    Sampled,
    Sampling,
    light_of,
    sampling_of,
)
from .stopping import finish_beauties, finish_low_samples

if TYPE_CHECKING:
    from xrds_core.denoising import Denoiser


_OF_OTHERS = Decision(
    "guides", "of the frames beside", "only the camera moves: they show the same"
)
_NOT_CACHED = Decision(
    GUIDE_CACHE, "off", "the camera moves: no frame has the guides of another"
)


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the network takes of one view, and what made it.

    `exposure` is the factor that brings radiance to middle grey, None to be found in
    the picture.
    """

    beauty: Beauty
    guides: Guides
    exposure: float | None
    skip_idle: bool
    decisions: tuple[Decision, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    temporal: Temporal | None = None

    @property
    def place(self) -> Beauty:
        """What holds the light's `offset` and its `others`, as in `LowPlace`."""
        return self.beauty

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture."""
        height, width = self.guides.alpha.shape
        return height, width


@dataclass(frozen=True, eq=False)
class View:
    """One view of a frame of a shot as the window stores it, noisy.

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


class SuperResolution(Method):
    """Light at low resolution, guides at full size, and the network."""

    last_stage = (stages.NETWORK, 3, 3)

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        settings, machine = request.settings, request.machine
        self._upscaler = load_upscaler(settings.network, machine)
        # of light that neighbours add to; a still's is denoised as it is rendered
        radius, quality = settings.temporal_radius, settings.quality
        self._denoiser = load_denoiser(quality, machine) if radius else None
        self._movement = Movement()

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        """As `Method.sample`; the result then holds the guides' data passes.

        A frame `between` two others takes its guides from them where that costs no
        detail.
        """
        how = sampling_of(engine, depsgraph, self.request, place)
        layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
        with CyclesPasses(
            engine, depsgraph, noisy=True, geometry=how.geometry
        ) as passes:
            facts = find_facts(depsgraph, self.settings)
            chosen = self.request.plan(facts)
            if not chosen.motion_blur:
                passes.hold_still()
            renders = _Renders(
                engine, depsgraph, self.request, how, passes, facts, chosen, layer_name
            )
            return renders.alone() if how.is_alone else renders.of_shot(between)

    def lacks(self, own: Sampled, others: Sequence[Sampled]) -> bool:
        return any(
            lacks_guides(own_view, own.neighbours(view, others))
            for view, own_view in own.views.items()
        )

    def finish(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        """As `Method.finish`; raises NetworkFailed."""
        inputs = own.views[view]
        if isinstance(inputs, View):
            assert self._denoiser is not None
            neighbours = own.neighbours(view, others)
            inputs = accumulated_inputs(
                inputs,
                neighbours,
                self.settings,
                self._denoiser,
                self._movement,
                own.strength,
            )
        started = time.perf_counter()
        try:
            picture = enlarge(
                inputs.beauty,
                inputs.guides,
                self.request,
                self._upscaler,
                exposure=inputs.exposure,
                skip_idle=inputs.skip_idle,
                progress=report,
            )
        except NetworkFailed as error:
            error.number = own.number
            raise
        seconds = {"network": time.perf_counter() - started}
        return Picture.of(
            picture,
            albedo=inputs.guides.albedo,
            normal=inputs.guides.normal,
            low_resolution=inputs.beauty.radiance,
            seconds=inputs.seconds | seconds,
            plan=inputs.decisions,
            peak_memory=peak_memory(),
            device=self._upscaler.device_name,
            settings=self.settings,
            temporal=inputs.temporal,
        )

    def light_passes(self, own: Sampled, view: str) -> dict[str, Array]:
        own_view = own.views[view]
        lights, offset = own_view.place.others, own_view.place.offset
        return enlarged_lights(lights, self.settings.scale, offset, own_view.shape)

    def stopped(self, own: Sampled) -> dict[str, Array]:
        first = next(iter(own.views.values()))
        machine = self.request.machine
        beauties = {
            view: _alone(own_view, machine) for view, own_view in own.views.items()
        }
        return enlarged(beauties, self.settings.scale, first.shape)


def _alone(view: View | Inputs, machine: Machine) -> Beauty:
    """The light of a view with its own samples alone, denoised."""
    if isinstance(view, Inputs):
        return view.beauty
    own = accumulate(view.light, ())
    return _denoised(view, own, load_denoiser("fast", machine))


# --- Sampling ------------------------------------------------------------------------


@dataclass(frozen=True)
class _Renders:
    """Both Cycles renders of one frame."""

    engine: Any
    depsgraph: Any
    request: Request
    how: Sampling
    passes: CyclesPasses
    facts: Facts
    chosen: Plan
    layer_name: str

    @property
    def settings(self) -> Settings:
        return self.request.settings

    def alone(self) -> Sampled:
        """The light of a still, denoised, and its guides: what the network takes."""
        beauties: dict[str, Beauty] = {}
        try:
            beauties = self._beauties()
            exposure = self._exposure()
            source = self._source(self.request, self.chosen.guide_samples)
            guides = self._guides(source, beauties)
        except Cancelled:
            if beauties:
                finish_beauties(self.engine, self.layer_name, self.request, beauties)
            else:
                self._finish_light()
            raise
        first = self.passes.views[0]
        rendered = beauties[first].seconds, guides[first].seconds
        decisions = (*self.chosen.decisions, source.decision)
        sync, again = sorted(seconds["sync"] for seconds in rendered)[::-1]
        if again:
            decisions += plan.after(sync, again)
        skip_idle = self.chosen.skip_idle
        views = {
            view: Inputs(beauty, guides[view], exposure, skip_idle, decisions)
            for view, beauty in beauties.items()
        }
        return Sampled(self.how.number, views, _summed(rendered))

    def of_shot(self, between: bool) -> Sampled:
        """The noisy light and guides of a frame that has neighbours."""
        light: dict[str, LowSamples] = {}
        try:
            light = self._noisy_light()
            views = self._views(light)
            rendered = [next(iter(light.values())).place.seconds]
            if between and self._is_shown_by_others():
                views_with_guides, decision = views, _OF_OTHERS
            else:
                views_with_guides, decision, seconds = self._with_guides(views, light)
                rendered.append(seconds)
        except Cancelled:
            self._finish_light(light)
            raise
        return Sampled(
            self.how.number,
            _with_decision(views_with_guides, decision),
            _summed(rendered),
        )

    def _finish_light(self, light: Mapping[str, LowSamples] | None = None) -> None:
        light = light or self.passes.stopped_samples(self.settings.scale)
        finish_low_samples(self.engine, self.layer_name, self.request, light)

    def _beauties(self) -> dict[str, Beauty]:
        """The denoised low-resolution light by view."""
        self._begin(stages.LOW, 1)
        settings = self.settings
        beauties = self.passes.beauties(
            settings.scale,
            settings.samples,
            denoise=self.chosen.denoise,
            seed=self.request.seed,
            denoiser=settings.cycles_denoising,
            in_process=in_process(settings.denoising, self.request.machine),
        )
        first = next(iter(beauties.values()))
        picture = np.dstack((first.radiance, first.alpha))
        live.show(picture, settings.scale, first.offset)
        return beauties

    def _noisy_light(self) -> dict[str, LowSamples]:
        """The noisy low-resolution light by view."""
        self._begin(stages.LOW, 1)
        how, settings = self.how, self.settings
        subset = how.subset()
        return self.passes.low_samples(
            settings.scale, settings.samples, seed=how.own_seed, subset=subset
        )

    def _exposure(self) -> float | None:
        return self.request.exposure or self.passes.border_exposure()

    def _views(self, light: Mapping[str, LowSamples]) -> dict[str, View]:
        """The views without guides."""
        exposure, region = self._exposure(), self.passes.region
        return {
            view: View(
                light=_stored_light(self.how, self.settings.scale, low, view),
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

    def _is_shown_by_others(self) -> bool:
        """Whether guides of the frames beside this one show what its own would show."""
        if (
            _OF_OTHERS.decision not in self.request.savings
            or not self.chosen.render_guides
        ):
            return False
        spare = {name for _, name in self.engine.spare_passes}
        requested = set(self.passes.pass_names()) - spare - {COMBINED}
        if not all(is_light(name) for name in requested):
            return False  # they come with the guides
        # under a camera that stands still guides are not rendered again anyway
        return self.how.place is None and not shapes_move(self.depsgraph)

    def _with_guides(
        self, views: Mapping[str, View], light: Mapping[str, LowSamples]
    ) -> tuple[dict[str, View], Decision, dict[str, float]]:
        """The views with guides, rendered or cached, why, and the seconds."""
        samples = self.chosen.guide_samples
        source = self._source(_guide_request(self.request, self.how, samples), samples)
        noisy = {v: low.place.beauty(low.samples.picture) for v, low in light.items()}
        guides = self._guides(source, noisy)
        with_guides = {
            view: replace(
                each, guides=self._stored(guides[view], view), guide_name=source.name
            )
            for view, each in views.items()
        }
        is_cached = self.how.place is not None or self.request.guide_cache is not None
        decision = source.decision if is_cached else _NOT_CACHED
        return with_guides, decision, next(iter(guides.values())).seconds

    def _source(self, request: Request, samples: int) -> GuideSource:
        return GuideSource(
            self.passes,
            self.depsgraph,
            request,
            self.chosen,
            self.facts,
            self.engine.report,
            self.how.other_subset(samples),
        )

    def _guides(
        self, source: GuideSource, light: dict[str, Beauty]
    ) -> dict[str, Guides]:
        self._begin(stages.GUIDES, 2)
        return source.guides(light)

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
        return store(frame)

    def _begin(self, stage: str, number: int) -> None:
        stages.begin(self.engine, self.how.named(stage), number)


def _with_decision(views: dict[str, View], decision: Decision) -> dict[str, View]:
    """The views with a decision in the place of that of its name."""

    def decided(plan: Plan) -> Plan:
        others = [d for d in plan.decisions if d.decision != decision.decision]
        return replace(plan, decisions=(*others, decision))

    return {name: replace(v, plan=decided(v.plan)) for name, v in views.items()}


def _guide_request(request: Request, how: Sampling, samples: int) -> Request:
    """Under a camera that stands still guides are accumulated until they are as many.

    Under another no frame finds what one before it has left, so memory is spared.
    """
    if how.place is not None:
        enough = samples * (2 * how.radius + 1)
        return replace(request, guide_limit=max(request.guide_limit, enough))
    savings = request.savings
    if request.guide_cache is None:
        savings = tuple(name for name in savings if name != _NOT_CACHED.decision)
    return replace(request, seed=how.own_seed, savings=savings)


def _stored_light(how: Sampling, scale: int, low: LowSamples, view: str) -> Stored:
    window = low.place.window.x, low.place.window.y
    camera = low_view(how.cameras[view], scale, window)
    return store(light_of(how, camera, low.samples))


def _summed(rendered: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Seconds by stage of all renders together."""
    names = {stage for seconds in rendered for stage in seconds}
    return {s: sum(seconds.get(s, 0.0) for seconds in rendered) for s in names}


# --- Finishing -----------------------------------------------------------------------


def accumulated_inputs(
    own: View,
    others: Sequence[View],
    settings: Settings,
    denoiser: Denoiser,
    movement: Movement,
    strength: float = 1.0,
) -> Inputs:
    """What the network takes of a view, with the samples of its neighbours.

    These count with a `strength`.
    """
    started = time.perf_counter()
    light = [frame.light for frame in others]
    accumulated = accumulate(own.light, light, movement, strength=strength)
    guides = accumulated_guides(own, others, movement, strength)
    done = time.perf_counter()
    beauty = _denoised(own, accumulated, denoiser)
    seconds = {
        "accumulate": done - started,
        "denoise": time.perf_counter() - done,
    }
    return Inputs(
        beauty,
        guides,
        own.exposure,
        own.plan.skip_idle,
        (*own.plan.decisions, accumulation(accumulated)),
        seconds,
        temporal(settings, accumulated),
    )


def _denoised(own: View, accumulated: Accumulated, denoiser: Denoiser) -> Beauty:
    assert accumulated.radiance is not None
    assert accumulated.alpha is not None
    picture = np.dstack((accumulated.radiance, accumulated.alpha))
    if not own.plan.denoise:
        return own.place.beauty(picture)
    denoised = denoiser(picture, accumulated.albedo, accumulated.normal)
    return own.place.beauty(denoised.radiance, accumulated.radiance)


def accumulated_guides(
    own: View, others: Sequence[View], movement: Movement, strength: float = 1.0
) -> Guides:
    """Guides with the samples of other frames; the richest of those of one name.

    A frame without guides of its own has them of others, whatever their `strength`.
    """
    others = [frame for frame in others if frame.guides is not None]
    if own.guide_name is not None:
        name = own.guide_name
        same = [own, *(frame for frame in others if name.is_same(frame.guide_name))]
        own = max(same, key=_samples)
        others = [frame for frame in others if frame not in same]
    neighbours = [frame.guides for frame in others if frame.guides is not None]
    target = own.guides
    if target is None:
        number = own.light.number
        beside = sorted(neighbours, key=lambda frame: abs(frame.number - number))[:2]
        target = reprojected_placeholder(number, own.camera, beside)
        strength = 1.0
    accumulated = accumulate(target, neighbours, movement, strength=strength)
    assert accumulated.alpha is not None
    # their own number: where nothing is accumulated there are no more
    samples = max(1, int(target.samples))
    return Guides(
        accumulated.albedo, accumulated.normal, accumulated.alpha, None, samples
    )


def lacks_guides(own: View, others: Sequence[View]) -> bool:
    """Whether a frame counted on guides of frames that a cut parts from it."""
    if not isinstance(own, View) or own.guides is not None:
        return False
    rich = [frame.light for frame in others if frame.guides is not None]
    return not same_shot(own.light, rich)


def _samples(view: View) -> float:
    return 0.0 if view.guides is None else view.guides.samples
