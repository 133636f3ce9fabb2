"""Cycles' samples at full size, denoised in this process; no network, no torch."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.equal_noise import IndependentFrames
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.denoising.light_passes import LightPart, passes_by_name
from xrds_core.denoising.light_sums import added_up, light_in
from xrds_core.errors import warn
from xrds_core.finish import finish_frame
from xrds_core.shot import Shot

from ..cycles.layer_session import LayerSession
from ..planning.plan import Decision, full_size
from ..planning.request import Request
from ..planning.settings import Denoising, Settings
from .loading import load_denoiser
from .methods import Method, Pace, Report
from .pace.deadline import Deadline, deadline
from .pace.more import More
from .pace.same_picture import same_picture
from .picture import Picture, Temporal, peak_memory
from .sampling import OnSampled, Sampled, sample_frame
from .time_budget import Timed

if TYPE_CHECKING:
    from xrds_core.accumulation.frame import Stored
    from xrds_core.denoising import Denoised


class FullSize(Method):
    """Samples at full size, denoised.

    `on_sampled` takes each frame that is sampled. `timed` is what fits into the time
    budget of a still: its request is this one.
    """

    def __init__(
        self,
        request: Request,
        on_sampled: OnSampled | None = None,
        timed: Timed | None = None,
    ) -> None:
        super().__init__(request)
        self._on_sampled, self._timed = on_sampled, timed or Timed(request)
        self._quality = self.settings.quality
        self._denoiser = load_denoiser(self._quality, request.machine)
        self._movement = Movement()
        self._independent = IndependentFrames(warn)

    def begin_shot(
        self, scene: Any, shot: Shot, *, layers: int = 1, beside: Pace | None = None
    ) -> None:
        if self.request.deadline is None:
            self.pace = same_picture(scene, self.request, shot)
        elif isinstance(beside, Deadline):
            self.pace = beside
        else:
            self.pace = deadline(scene, self.request, shot, layers)

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        pace = self.pace
        if pace is None:
            return sample_frame(
                engine, depsgraph, self.request, place, self._on_sampled
            )
        number = depsgraph.scene_eval.frame_current
        # it may be sampled several times: Cycles must not free the dependency graph
        with LayerSession(engine, depsgraph):
            while True:
                request = pace.request(self.request, number)
                sampled = sample_frame(engine, depsgraph, request, place)
                if pace.takes(self, sampled):
                    return sampled

    def prepare(self, own: Sampled, others: Sequence[Sampled]) -> Any:
        return None if self.pace is None else self.pace.prepare(self, own, others)

    def complete(
        self, own: Sampled, others: Sequence[Sampled], more: More, prepared: Any
    ) -> Sampled:
        if self.pace is None:
            return own
        return self.pace.complete(self, own, others, more, prepared)

    def begin_finishing(self, engine: Any) -> Report:
        if self._timed.denoise_in_time is not None:
            self._quality = self._timed.denoise_in_time()
            self._denoiser = load_denoiser(self._quality, self.request.machine)
        return super().begin_finishing(engine)

    def finish(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        frame = own.views[view]
        if isinstance(frame, Passes):
            picture = self._alone(frame, report, own.light)
        else:
            neighbours = self._neighbours(own, others, view)
            gathered = own.gathered.get(view)
            picture = self.finish_stored(
                frame, neighbours, report, gathered, own.light, own.strength
            )
        settings = picture.settings
        assert settings is not None
        samples = own.samples or settings.samples
        settings = replace(settings, share=own.share, samples=samples)
        plan = (*self._timed.decisions, *picture.plan, *own.decisions)
        return replace(picture, settings=settings, plan=plan)

    def accumulate(
        self, own: Sampled, others: Sequence[Sampled], view: str
    ) -> Accumulated:
        """One view with the samples of its neighbours."""
        neighbours = self._neighbours(own, others, view)
        return accumulate(
            own.views[view], neighbours, self._movement, strength=own.strength
        )

    def radiance(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        region: tuple[slice, slice],
    ) -> Array:
        """Rows and columns of the picture of one view, (H, W, 3), denoised alone."""
        finished = finish_frame(
            own.views[view],
            self._neighbours(own, others, view),
            self._denoiser,
            self._movement,
            region=region,
            accumulated=own.gathered.get(view),
            strength=own.strength,
        )
        return finished.picture[..., :3]

    def _neighbours(
        self, own: Sampled, others: Sequence[Sampled], view: str
    ) -> list[Stored]:
        """The neighbours of one view; cached ones may have the same samples."""
        return self._independent.of(own.views[view], own.neighbours(view, others))

    def as_by_cycles(self, radiance: Array, albedo: Array, normal: Array) -> Array:
        """Samples by themselves, denoised as Cycles does in a new file."""
        denoiser = load_denoiser("accurate", self.request.machine)
        return denoiser(radiance, albedo, normal).radiance

    def finish_stored(
        self,
        own: Stored,
        neighbours: Sequence[Stored],
        report: Report | None = None,
        gathered: Accumulated | None = None,
        light: Sequence[LightPart] = (),
        strength: float = 1.0,
    ) -> Picture:
        """The picture of a packed frame with the samples of its neighbours."""
        finished = finish_frame(
            own,
            neighbours,
            self._denoiser,
            self._movement,
            report,
            accumulated=gathered,
            light=light,
            strength=strength,
        )
        accumulated = finished.accumulated
        picture = self._picture(
            finished.denoised,
            accumulated.albedo,
            accumulated.normal,
            finished.seconds,
            decisions=(accumulation(accumulated),),
            temporal=temporal(self.settings, accumulated),
        )
        return replace(picture, parts=passes_by_name(light, finished.parts))

    def _alone(
        self, samples: Passes, report: Report | None, light: Sequence[LightPart]
    ) -> Picture:
        started = time.perf_counter()
        assert samples.radiance is not None
        denoised = self._denoiser(
            samples.picture,
            samples.albedo,
            samples.normal,
            parts=light_in(samples.radiance, samples.parts, light),
            progress=report,
        )
        made = denoised.radiance, denoised.parts
        parts = {**samples.parts, **added_up(*made, light, samples.parts)}
        seconds = {"denoise": time.perf_counter() - started}
        decisions = in_time(self.settings.quality, self._quality)
        picture = self._picture(
            denoised, samples.albedo, samples.normal, seconds, decisions=decisions
        )
        return replace(picture, parts=passes_by_name(light, parts))

    def _picture(
        self,
        denoised: Denoised,
        albedo: Array,
        normal: Array,
        seconds: dict[str, float],
        *,
        decisions: tuple[Decision, ...],
        temporal: Temporal | None = None,
    ) -> Picture:
        return Picture.of(
            denoised.radiance,
            albedo=albedo,
            normal=normal,
            seconds=seconds,
            plan=(*full_size(self._quality).decisions, *decisions, prefilter(denoised)),
            peak_memory=peak_memory(),
            device=self._denoiser.device,
            settings=replace(self.settings, denoising=Denoising.ours(self._quality)),
            temporal=temporal,
        )

    def stopped(self, own: Sampled) -> dict[str, Array]:
        fast = self.request.with_settings(denoising=Denoising.XRDS_FAST)
        alone = FullSize(fast)
        return {
            view: alone.finish(_only(own, view), (), view).pixels for view in own.views
        }


def _only(sampled: Sampled, view: str) -> Sampled:
    """One view, without what the others would add to it."""
    return replace(sampled, views={view: sampled.views[view]})


def temporal(settings: Settings, accumulated: Accumulated) -> Temporal:
    """What neighbours added to a picture, as it reports."""
    samples = float(accumulated.samples.mean())
    radius = settings.temporal_radius
    return Temporal(radius, accumulated.frames, samples, accumulated.rejected)


def accumulation(accumulated: Accumulated) -> Decision:
    """What was decided where neighbours' samples were reused."""
    frames = accumulated.frames
    reason = "neighbouring frames show the same: their samples count here as well"
    return Decision("accumulation", f"frames {frames[0]} to {frames[-1]}", reason)


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
