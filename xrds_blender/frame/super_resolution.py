"""The paper's way: low-resolution light, full-resolution guides, and the network."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import Cancelled

from ..cycles import live, session
from ..cycles.pass_names import COMBINED
from ..cycles.passes import CyclesPasses
from ..cycles.rendered import Beauty, Guides
from ..planning import plan
from . import progress
from .denoisers import in_process
from .enlarging import enlarge, enlarged_lights
from .facts import find_facts
from .guides import GuideSource
from .job import NetworkFailed, Picture, RenderJob
from .memory import peak_memory
from .stopping import enlarged, keep_beauties, keep_low_samples

if TYPE_CHECKING:
    from xrds_core import Upscaler


@dataclass(frozen=True)
class Inputs:
    """What Cycles rendered of one layer for the network; by name of the view.

    `exposure` is the factor that brings radiance to middle grey, None to be found in
    the picture.
    """

    beauties: dict[str, Beauty]
    guides: dict[str, Guides]
    exposure: float | None
    decisions: tuple[plan.Decision, ...]
    skip_idle: bool

    @property
    def first(self) -> tuple[Beauty, Guides]:
        """Those of the first view."""
        name = next(iter(self.beauties))
        return self.beauties[name], self.guides[name]


def render_enlarged(
    engine: Any, depsgraph: Any, job: RenderJob, upscaler: Upscaler
) -> Picture:
    """Render into the engine's result and return the first view's picture.

    Raises Cancelled when the user stops it, and NetworkFailed with the low-resolution
    picture in the result, enlarged.
    """
    inputs = render_inputs(engine, depsgraph, job)
    layer = depsgraph.view_layer_eval.name
    enlargement = _Enlargement(engine, layer, job, upscaler, inputs)
    seconds = _seconds(inputs)
    try:
        with _Timed(seconds, "network"):
            pictures = enlargement.pictures()
        session.stop_if_cancelled(engine)
    except Cancelled:
        keep_beauties(engine, layer, job, inputs.beauties)
        raise
    with _Timed(seconds, "write"):
        enlargement.write(pictures)
    beauty, guides = inputs.first
    picture = next(iter(pictures.values()))
    return Picture(
        radiance=np.ascontiguousarray(picture[..., :3]),
        alpha=np.ascontiguousarray(picture[..., 3]),
        albedo=guides.albedo,
        normal=guides.normal,
        low_resolution=beauty.radiance,
        seconds=seconds,
        plan=inputs.decisions,
        peak_memory=peak_memory(),
        device=str(upscaler.device),
    )


def render_inputs(engine: Any, depsgraph: Any, job: RenderJob) -> Inputs:
    """Render light and guides; the result then holds the guides' data passes.

    Raises Cancelled when the user stops it.
    """
    layer = depsgraph.view_layer_eval.name
    with CyclesPasses(engine, depsgraph, noisy=True) as passes:
        facts = find_facts(depsgraph, job)
        chosen = job.plan(facts)
        if not chosen.motion_blur:
            passes.hold_still()
        source = GuideSource(passes, depsgraph, job, chosen, facts, engine.report)
        renders = _Renders(engine, layer, job, chosen, passes, source)
        render = renders.guides_first if job.guides == "full" else renders.light_first
        beauties, guides, exposure = render()
    first = passes.views[0]
    syncs = sorted(each.seconds["sync"] for each in (beauties[first], guides[first]))
    decisions = (*chosen.decisions, source.decision)
    if syncs[0]:
        decisions += plan.after(syncs[1], syncs[0])
    return Inputs(beauties, guides, exposure, decisions, chosen.skip_idle)


_Rendered = tuple[dict[str, Beauty], dict[str, Guides], float | None]


@dataclass(frozen=True)
class _Renders:
    """Both Cycles renders of one layer, in either order."""

    engine: Any
    layer: str
    job: RenderJob
    chosen: plan.Plan
    passes: CyclesPasses
    source: GuideSource

    def light_first(self) -> _Rendered:
        progress.begin(self.engine, progress.LOW, 1)
        beauties, exposure = self.light()
        progress.begin(self.engine, progress.GUIDES, 2)
        try:
            return beauties, self.source.guides(beauties), exposure
        except Cancelled:
            keep_beauties(self.engine, self.layer, self.job, beauties)
            raise

    def guides_first(self) -> _Rendered:
        """Fewer samples first: noise that matters, and one sync all the same."""
        progress.begin(self.engine, progress.GUIDES, 1)
        guides, data = self.source.guides(), self.passes.data_passes()
        progress.begin(self.engine, progress.LOW, 2)
        beauties, exposure = self.light()
        self.passes.put_back(data)
        return beauties, guides, exposure

    def light(self) -> tuple[dict[str, Beauty], float | None]:
        """The low-resolution pictures by view, and the exposure if it is known."""
        job = self.job
        try:
            beauties = self.passes.beauties(
                job.scale,
                job.samples,
                denoise=self.chosen.denoise,
                seed=job.seed,
                denoiser=job.denoiser,
                in_process=in_process(job),
            )
        except Cancelled:
            light = self.passes.stopped_samples(job.scale)
            keep_low_samples(self.engine, self.layer, job, light)
            raise
        first = next(iter(beauties.values()))
        live.show(np.dstack((first.radiance, first.alpha)), job.scale, first.offset)
        return beauties, job.exposure or self.passes.border_exposure()


def _seconds(inputs: Inputs) -> dict[str, float]:
    """Seconds by stage of what was rendered."""
    seconds = dict.fromkeys(progress.STAGES, 0.0)
    for rendered in inputs.first:
        for stage, value in rendered.seconds.items():
            seconds[stage] += value
    return seconds


class _Timed:
    """Sets the seconds of a stage to what passes inside the `with`."""

    def __init__(self, seconds: dict[str, float], stage: str) -> None:
        self._seconds, self._stage = seconds, stage

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._seconds[self._stage] = time.perf_counter() - self._start


@dataclass(frozen=True)
class _Enlargement:
    """The network's part of a render, from what Cycles rendered of one layer."""

    engine: Any
    layer: str
    job: RenderJob
    upscaler: Upscaler
    inputs: Inputs

    def pictures(self) -> dict[str, Array]:
        """By view, (H, W, 4); NetworkFailed leaves enlarged ones in the result."""
        progress.begin(self.engine, progress.NETWORK, 3)
        try:
            return {view: self.upscaled(view) for view in self.inputs.beauties}
        except NetworkFailed:
            size = next(iter(self.inputs.guides.values())).alpha.shape
            self.write(enlarged(self.inputs.beauties, self.job.scale, size))
            raise

    def upscaled(self, view: str) -> Array:
        """The region's radiance and alpha, (H, W, 4)."""
        return enlarge(
            self.inputs.beauties[view],
            self.inputs.guides[view],
            self.job,
            self.upscaler,
            exposure=self.inputs.exposure,
            skip_idle=self.inputs.skip_idle,
            progress=progress.reporter(self.engine),
        )

    def write(self, pictures: dict[str, Array]) -> None:
        """Put the pictures and the enlarged light passes into the engine's result."""
        result = self.engine.get_result()
        layer = result.layers[self.layer]
        for view, picture in pictures.items():
            session.write_pass(layer, COMBINED, view, picture)
            beauty, scale = self.inputs.beauties[view], self.job.scale
            lights = enlarged_lights(beauty.others, scale, beauty.offset, picture.shape)
            for name, large in lights.items():
                session.write_pass(layer, name, view, large)
        self.engine.update_result(result)
