"""What a time budget or a quality becomes, for a still or for all frames of a shot.

Settings that changed from frame to frame would be seen, and frames of other settings
could not use each other's samples.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from xrds_core.errors import XRDSError

from ..cycles import low_resolution, session
from ..cycles.passes import CyclesPasses
from ..cycles.session import has_denoiser
from ..cycles.view import can_track, frame_size
from ..planning import budget
from ..planning import estimates as estimating
from ..planning.budget import Costs, ErrorModel, Selection
from ..planning.estimates import Capabilities, Estimate
from ..planning.plan import Decision, Facts, SceneFacts
from ..planning.request import Request
from ..planning.settings import (
    CYCLES_DENOISING,
    OUR_DENOISING,
    Denoising,
    Mode,
    Network,
    Settings,
)
from ..scene.contents import scene_facts
from . import history, loading, stages
from .loading import capabilities, is_ready, networks_at_hand
from .picture import Picture
from .probing import probe, with_guides, with_network


@dataclass(frozen=True)
class Chosen:
    """The request as it is rendered, with nothing left to choose, and why it is this.

    `denoise_in_time` gives the quality of our denoiser once the samples are there, by
    the seconds that are left then; None where nothing is left to choose.
    """

    request: Request
    decisions: tuple[Decision, ...] = ()
    denoise_in_time: Callable[[], str] | None = None

    def all_decisions(self, rest: tuple[Decision, ...]) -> tuple[Decision, ...]:
        """Why it is this, and the rest; of Cycles alone the choice says all."""
        alone = self.decisions and self.request.settings.is_cycles_only
        return self.decisions if alone else (*self.decisions, *rest)

    def described(self, picture: Picture) -> Picture:
        """A picture with what it was rendered by."""
        settings = picture.settings or self.request.settings
        return replace(
            picture, plan=self.all_decisions(picture.plan), settings=settings
        )


@contextmanager
def chosen(
    engine: Any, depsgraph: Any, request: Request, start: float, shot: bool = False
) -> Iterator[Chosen]:
    """Choose what a request leaves open, by probes of the frame.

    Inside the `with` Cycles has the session of the probes, with its scene. `start` and
    `shot` are as in `select`, which says what is raised.
    """
    if request.goal is None:
        yield Chosen(request)
        return
    with CyclesPasses(engine, depsgraph) as passes:
        found = select(passes, request, start, shot=shot)
        (decision,) = found.decisions
        engine.report({"INFO"}, f"XRDS: {decision.value}: {decision.reason}")
        yield found


def choose_for_shot(engine: Any, depsgraph: Any, request: Request) -> Chosen:
    """Choose what the request of a shot leaves open; raises what `select` raises."""
    try:
        with chosen(
            engine, depsgraph, request, time.perf_counter(), shot=True
        ) as found:
            return found
    finally:
        stages.end()


def select(
    passes: CyclesPasses, request: Request, start: float, *, shot: bool = False
) -> Chosen:
    """The settings for the goal of a request.

    `start` is the perf_counter reading from which a time budget counts; what has passed
    since then and what the probes take is part of it. Where the request is for all
    frames of a `shot`, which give each other their samples, the budget is what a frame
    takes on the mean, and the probes come on top once.
    Raises XRDSError where nothing can denoise.
    """
    assert request.goal is not None
    model, machine = budget.shipped(), request.machine
    wanted = request.settings
    errors = model.errors.limited(_denoising())
    networks = [n for n in _networks(request) if n in model.network_speed]
    if shot:
        errors = errors.in_shot(wanted.temporal_radius)

    def choose() -> Selection:
        known = costs.in_shot(wanted.temporal_radius) if shot else costs
        return _choose(request, known, errors, networks)

    costs = probe(passes, model, networks, start, machine)
    found = choose()
    if found.settings.is_enlarged:  # guides and network were guesses so far
        costs = with_guides(costs, passes)
        found = choose()
    if found.settings.is_enlarged:  # the other networks are slower by as much
        costs = with_network(costs, found.settings.network, machine, passes)
        found = choose()
    settings, seconds = found.settings, request.goal.seconds
    decision = found.decision(request.goal)
    settings = replace(settings, temporal_radius=wanted.temporal_radius)
    if not settings.is_enlarged:
        settings = replace(
            settings, preset=wanted.preset, guide_samples=wanted.guide_samples
        )
    result = Chosen(replace(request, settings=settings, goal=None), (decision,))
    is_ours = settings.mode is Mode.FULL_SIZE
    if seconds is None or shot or not is_ours or not found.fits:  # or late by intent
        return result

    def denoise_in_time() -> str:
        spent = time.perf_counter() - start
        return budget.denoiser_in_time(spent, seconds, settings, costs, errors).quality

    return replace(result, denoise_in_time=denoise_in_time)


def foresee(
    scene: Any, request: Request, networks: Sequence[Network], shot: bool = False
) -> Selection | None:
    """What will about be chosen, by the scene's last renders; None without any.

    `networks` are those whose weights are there; `shot` is as in `select`.
    """
    costs = history.costs(scene)
    if costs is None:
        return None
    known = [n for n in networks if n in costs.network]
    errors = budget.shipped().errors.limited(_denoising())
    if shot:
        radius = request.settings.temporal_radius
        costs, errors = costs.in_shot(radius), errors.in_shot(radius)
    return _choose(request, costs, errors, known)


def _networks(request: Request) -> list[Network]:
    """Those whose weights are there; none where Cycles is to be alone, or no PyTorch.

    By the files' headers alone: a budget has no seconds for the rest of them.
    """
    weights = request.machine.weights
    if request.settings.is_cycles_only or not is_ready():
        return []
    if weights is not None and not Path(weights).is_dir():
        return [request.settings.network]
    return networks_at_hand(weights)


def _denoising() -> tuple[Denoising, ...]:
    """Those to choose from: ours, or Cycles' where ours is missing.

    Ours has every network of Cycles' and is no slower. Raises XRDSError where nothing
    can denoise: every expected error is of a denoised picture.
    """
    if loading.has_library():
        return OUR_DENOISING
    if has_denoiser():
        return CYCLES_DENOISING
    raise XRDSError(
        "neither this Blender nor its Python has Open Image Denoise, without which "
        "nothing is known of a picture's quality: install XRDS from its zip, or "
        "choose the settings yourself in place of a time budget or a quality"
    )


def _choose(
    request: Request, costs: Costs, errors: ErrorModel, networks: Sequence[Network]
) -> Selection:
    goal = request.goal
    assert goal is not None
    if goal.seconds is not None:
        return budget.choose(goal.seconds, costs, errors, networks)
    assert goal.decibels is not None
    return budget.reach(goal.decibels, costs, errors, networks)


BEST = Denoising.XRDS_HIGH
"""What automatic takes: `best` doubles the seconds for 0.2 to 0.3 decibels."""


def estimates(
    scene: Any, settings: Settings, here: Capabilities, shot: bool = False
) -> list[Estimate]:
    """What to expect of each mode that can work, at the scene's present samples.

    In a `shot` frames have the samples of their neighbours.
    """
    radius = settings.temporal_radius if shot else 0

    def seconds(resolved: Settings) -> float | None:
        return frame_seconds(scene, resolved, radius)

    known, model = history.scene_settings(scene), budget.shipped()
    return estimating.estimates(settings, known, here, model, seconds, radius)


def frame_seconds(scene: Any, resolved: Settings, radius: int) -> float | None:
    """What a frame will about take that reuses `radius` frames before and after.

    None where nothing is known; the settings are resolved.
    """
    costs = history.costs(scene)
    if not radius or costs is None or resolved.is_cycles_only:
        return history.seconds(scene, resolved)
    return costs.in_shot(radius).seconds(resolved)


def in_mode(request: Request, mode: Mode) -> Request:
    """The request in a mode; automatic is full size wherever it can work.

    What a goal will choose stays open.
    """
    if request.goal is not None:
        return request
    if mode is Mode.AUTOMATIC:
        paced = request.deadline is not None  # which Cycles alone cannot keep
        here = capabilities(request.machine.weights)
        mode = Mode.FULL_SIZE if paced else estimating.automatic(here)
        request = request.with_settings(denoising=BEST)
    if mode is Mode.CYCLES_ONLY:
        return request.with_settings(mode=mode, temporal_radius=0)
    return request.with_settings(mode=mode)


# Core-seconds of a million guide samples with nothing left out, as measured in
# docs/lab/measurements.md.
CORE_SECONDS = 4.8


def find_facts(depsgraph: Any, settings: Settings) -> Facts:
    """The facts of a frame, from an evaluated scene."""
    return join_facts(depsgraph.scene_eval, settings, scene_facts(depsgraph))


def join_facts(scene: Any, settings: Settings, scene_facts: SceneFacts) -> Facts:
    """The facts of a frame, with those of its scene at hand."""
    width, height = frame_size(scene.render)
    camera = scene.camera
    return Facts(
        scale=settings.scale,
        width=width,
        height=height,
        max_bounces=scene.cycles.max_bounces,
        has_denoiser=session.has_denoiser() or loading.has_library(),
        reprojects=camera is None or can_track(scene),
        exact_camera=camera is None or low_resolution.is_exact(camera.data),
        guide_samples=settings.guide_samples,
        scene=scene_facts,
        guide_seconds=_guide_seconds(scene, width * height * settings.guide_samples),
    )


def _guide_seconds(scene: Any, samples: int) -> float | None:
    """Estimate of a whole guide render; None on a GPU, of which nothing is known."""
    if scene.cycles.device != "CPU":
        return None
    return CORE_SECONDS * samples / 1e6 / (os.cpu_count() or 1)
