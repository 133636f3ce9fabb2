"""The noisy samples of one frame of a shot, packed for the window."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from xrds_core.accumulation.accumulate import Accumulated
from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame, store
from xrds_core.accumulation.passes import Passes
from xrds_core.accumulation.sample_subsets import (
    SampleSubset,
    consecutive_subset,
    running_subset,
)
from xrds_core.denoising.light_passes import LightPart, find_parts
from xrds_core.errors import Cancelled, SceneError
from xrds_core.exr.channels import Channels

from ..cycles import session
from ..cycles.halves import sample_halves, sample_motion, seconds_of
from ..cycles.layer_session import LayerSession
from ..cycles.object_strength import sample_strengths
from ..cycles.samples import (
    COUNTS,
    GEOMETRY,
    LATE_DEPTH,
    PATH_LENGTH,
    sample_layer,
)
from ..cycles.settings import has_subsets, set_share, subset_of_file
from ..cycles.view import cameras_of, can_track
from ..internals.borrowed import Borrowed
from ..planning.plan import Decision
from ..planning.request import Request
from ..scene.contents import scene_facts, shapes_move, stands_still
from ..scene.strength import neighbours_count, weak_objects
from . import stages
from .stopping import finish_samples

# Frames of one seed would have the same noise, and gain nothing from each other.
SEED_STEP = 7919
_LARGEST_SEED = 2**31 - 1
_OTHER = 1_299_709  # seeds apart; no frame's is near those of another
_FEWEST = 1.0  # samples, on the mean of a frame


OnSampled = Callable[[Mapping[str, Frame]], object]
"""Takes a frame's samples by view, to be used another time."""


@dataclass(frozen=True)
class Sampled:
    """One frame before it is finished, by view, and the seconds that it took.

    At full size views are `Stored`, of a still `Passes`; above scale 1 they are a
    `View` or `Inputs` of `super_resolution`; of Cycles alone finished pictures.
    `gathered` are views with their neighbours' samples, where that is known already.
    Where `samples` per pixel were requested it has these; else `share` is how much of
    the file's. `decisions` say why. `light` are the parts of it that views hold.
    Neighbours count with a `strength`, beside that of each pixel.
    """

    number: int
    views: dict[str, Any]
    seconds: dict[str, float]
    gathered: Mapping[str, Accumulated] = field(default_factory=dict)
    samples: int | None = None
    share: float = 1.0
    decisions: tuple[Decision, ...] = ()
    light: tuple[LightPart, ...] = ()
    strength: float = 1.0

    def neighbours(self, view: str, frames: Sequence[Sampled]) -> list[Any]:
        """That view of other frames, and this frame's other views."""
        beside = [own for name, own in self.views.items() if name != view]
        return [x.views[view] for x in frames if view in x.views] + beside


@dataclass(frozen=True)
class Sampling:
    """How a frame is sampled, and the cameras that see it, by view.

    `count` samples per pixel; `geometry` names passes. `place` is the frame's in the
    shot where frames continue one sequence, None where each has one of its own; its
    samples `begin` after so many, None is by its place. `most` are the samples that a
    frame may take there.
    `still` is as in `Frame`. A frame that `has_halves` is sampled in two; one that
    `needs_motion` is rendered once more without motion blur for its motion. One that
    `is_alone` has no neighbours: it is sampled as its file has it. `light` are the
    parts of it that are wanted.
    """

    number: int
    cameras: dict[str, Camera] = field(default_factory=dict)
    count: int = 0
    most: int = 0
    seed: int = 0
    geometry: Sequence[tuple[str, str]] = ()
    place: int | None = None
    begin: int | None = None
    radius: int = 0
    still: bool = False
    has_halves: bool = False
    needs_motion: bool = False
    light: tuple[LightPart, ...] = ()

    @property
    def is_alone(self) -> bool:
        """Whether the frame has no neighbours."""
        return not self.radius

    @property
    def has_length(self) -> bool:
        """Whether what is sampled as depth is a length along the ray."""
        is_late = LATE_DEPTH in self.geometry and GEOMETRY[0] not in self.geometry
        return is_late and not (self.has_halves and self.needs_motion)

    def named(self, stage: str) -> str:
        """A stage's name in the status bar, with the frame's number in a shot."""
        return stage if self.is_alone else f"{stage} of frame {self.number}"

    def subset(self) -> SampleSubset | None:
        """The frame's part of the sequence that it continues; None of one of its own.

        A part has fewer samples than all where the frame takes fewer: those of adjacent
        frames are to lie side by side.
        """
        if self.place is None:
            return None
        if self.begin is not None:
            return running_subset(self.begin, self.count, self.most, self.seed)
        return consecutive_subset(
            self.place, self.count, self.radius, self.seed, self.most
        )

    @property
    def shared(self) -> int | None:
        """The number of the frame's part of a sequence that others continue."""
        return None if self.place is None else subset_at(self.place, self.radius)

    def other_subset(self, count: int) -> SampleSubset | None:
        """As `subset`, of `count` samples of a sequence with another seed."""
        if self.place is None:
            return None
        return consecutive_subset(self.place, count, self.radius, self.seed + 1)

    @property
    def first(self) -> SampleSubset:
        """The samples that the frame takes.

        All of their sequence where that is its own: the first of a longer one are of a
        worse pattern, and under a noise threshold stop later.
        """
        return self.subset() or SampleSubset(self.own_seed, self.count, 0, self.count)

    def further(
        self, length: int, begin: int | None, sequence: int, count: int = 0
    ) -> list[SampleSubset]:
        """More samples of the frame, of a sequence of their own that has a number.

        Of several ones of `count` samples where that is not 0. With `begin` they are of
        one that all frames share, after so many taken of it.
        """
        if begin is not None:
            return [running_subset(begin, length, self.most, self.seed + 1)]
        count = count or length
        return [
            SampleSubset(
                (self.own_seed + (sequence + i) * _OTHER) % _LARGEST_SEED,
                count,
                0,
                min(count, length - first),
            )
            for i, first in enumerate(range(0, length, count))
        ]

    @property
    def own_seed(self) -> int:
        """One that no other frame has."""
        return (self.seed + self.number * SEED_STEP) % _LARGEST_SEED


def subset_at(place: int, radius: int) -> int:
    """The number of a frame's subset, of as many as a frame has in its window."""
    return place % (2 * radius + 1)


def has_neighbours(scene: Any, request: Request) -> bool:
    """Whether frames of a shot are to use, and can use, each other's samples.

    Not under most panoramic cameras, nor where these count for nothing.
    """
    if request.settings.is_cycles_only or not request.settings.temporal_radius:
        return False
    if not neighbours_count(scene, request):
        return False
    return scene.camera is not None and can_track(scene)


def can_continue(scene: Any, request: Request) -> bool:
    """Whether frames can take parts of one sequence: where pixels stand still.

    And where the file does not let Cycles decide how many samples a pixel takes.
    """
    cycles, samples = scene.cycles, request.settings.samples
    if samples is None and subset_of_file(cycles, cycles.samples) != (
        0,
        cycles.samples,
    ):
        return False  # the file says which part of a sequence it takes
    return stands_still(scene.camera) and has_subsets(scene) and is_even(scene, request)


def sampling_of(
    engine: Any, depsgraph: Any, request: Request, place: int | None
) -> Sampling:
    """How the frame that the dependency graph is at is to be sampled.

    Without a temporal radius it has no neighbours. `place`, the frame's in the shot,
    lets frames under a camera that stands still continue one sequence; passes of its
    first sample alone, as Depth, are empty in the result then. Raises SceneError under
    a camera that no matrix describes.
    """
    scene = depsgraph.scene_eval
    if not request.settings.temporal_radius:
        return Sampling(scene.frame_current)
    cameras = cameras_of(engine, depsgraph)
    if not cameras:
        raise SceneError(
            "such panoramas cannot be reprojected; set the temporal radius to 0"
        )
    even = is_even(scene, request)
    if not can_continue(scene, request):
        place = None
    facts = scene_facts(depsgraph)
    geometry = [*_geometry(depsgraph), *([] if even else [COUNTS])]
    settings = request.settings
    offset, of_file = subset_of_file(scene.cycles, session.samples_of(depsgraph))
    seed = scene.cycles.seed if request.seed is None else request.seed
    blurred = scene.render.use_motion_blur
    if place is not None or (offset and settings.samples is None):
        geometry[0] = LATE_DEPTH
    elif facts.smooth and not request.settings.is_enlarged:
        geometry.append(PATH_LENGTH)
    return Sampling(
        number=scene.frame_current,
        cameras=cameras,
        count=settings.count(of_file),
        most=settings.samples or of_file,
        seed=seed,
        geometry=geometry,
        place=place,
        begin=settings.begin,
        radius=request.settings.temporal_radius,
        still=not facts.moving,
        has_halves=_has_halves(scene, request, settings.count(of_file)),
        needs_motion=blurred and shapes_move(depsgraph),
        light=parts_of_layer(engine, depsgraph, request),
    )


def parts_of_layer(
    engine: Any, depsgraph: Any, request: Request
) -> tuple[LightPart, ...]:
    """The parts of its light that the request wants of a layer.

    Raises UsageError for names that it does not have.
    """
    if not request.light:
        return ()
    name = depsgraph.view_layer_eval.name
    names = {
        f"{render_pass.name}.{letter}": None
        for render_pass in engine.get_result().layers[name].passes
        if render_pass.channel_id in ("RGB", "RGBA")
        for letter in "RGB"
    }
    return find_parts(Channels(f"view layer {name!r}", names), "", request.light)


def is_even(scene: Any, request: Request) -> bool:
    """Whether every pixel takes as many samples as are requested."""
    cycles = scene.cycles
    decides = cycles.use_adaptive_sampling or cycles.time_limit
    return request.settings.samples is not None or not decides


def _has_halves(scene: Any, request: Request, count: int) -> bool:
    """Whether a frame's samples can be had in two halves that add up to all."""
    if count < 2 or not has_subsets(scene):
        return False
    cycles = scene.cycles
    return request.settings.samples is not None or not (
        cycles.use_sample_subset or cycles.time_limit
    )


def sample_frame(
    engine: Any,
    depsgraph: Any,
    request: Request,
    place: int | None = None,
    on_sampled: OnSampled | None = None,
) -> Sampled:
    """Render the frame that the dependency graph is at; the result holds its passes.

    A frame with neighbours is rendered as `noisy_frame` does it and packed for the
    window; `on_sampled` takes its views before that. Raises what `noisy_frame` does.
    """
    number, count = depsgraph.scene_eval.frame_current, request.settings.own_samples
    light = parts_of_layer(engine, depsgraph, request)
    if not request.settings.temporal_radius:
        samples, seconds = _alone(engine, depsgraph, request, light)
        return Sampled(number, dict(samples), seconds, samples=count, light=light)
    frames, seconds = noisy_frame(engine, depsgraph, request, place)
    if on_sampled is not None:
        on_sampled(frames)
    views = {view: store(frame) for view, frame in frames.items()}
    return Sampled(number, views, seconds, samples=count, light=light)


def _alone(
    engine: Any, depsgraph: Any, request: Request, light: Sequence[LightPart]
) -> tuple[dict[str, Passes], dict[str, float]]:
    """Render a frame without neighbours, as `noisy_frame` does; seed as in the file."""
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    stages.begin(engine, stages.SAMPLES, 1, 2)
    try:
        samples, clock = sample_layer(
            engine,
            depsgraph,
            samples=request.settings.samples,
            seed=request.seed,
            light=light,
        )
    except Cancelled:
        finish_samples(engine, layer_name, request)
        raise
    return samples, {"sync": clock.sync, "beauty": clock.render}


def noisy_frame(
    engine: Any, depsgraph: Any, request: Request, place: int | None = None
) -> tuple[dict[str, Frame], dict[str, float]]:
    """Render the frame that the dependency graph is at; the result holds its passes.

    Returns its samples by view, and the seconds of the stages. Every frame has samples
    of its own, whatever the file's seed says; `place` is as in `sampling_of`. Raises
    Cancelled when the user stops it, and what `sampling_of` does.
    """
    how = sampling_of(engine, depsgraph, request, place)
    if not weak_objects(depsgraph.ids):
        return _sampled_frame(engine, depsgraph, request, how)
    # else Cycles would free the dependency graph after the first render
    with LayerSession(engine, depsgraph):
        strengths, clock = sample_strengths(engine, depsgraph, how.own_seed)
        frames, seconds = _sampled_frame(engine, depsgraph, request, how)
    frames = {v: replace(x, strength=strengths[v]) for v, x in frames.items()}
    more = seconds_of([clock])
    return frames, {stage: seconds[stage] + more[stage] for stage in seconds}


def _sampled_frame(
    engine: Any, depsgraph: Any, request: Request, how: Sampling
) -> tuple[dict[str, Frame], dict[str, float]]:
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    settings = request.settings
    stages.begin(engine, how.named(stages.SAMPLES), 1, 2)
    try:
        with Borrowed() as borrowed:
            if settings.share < 1.0:
                scene = depsgraph.scene_eval
                most = session.samples_of(depsgraph)
                set_share(borrowed, scene, most, settings.share)
            if how.has_halves:
                return _frames_of_halves(engine, depsgraph, how)
            noisy, clock = sample_layer(
                engine,
                depsgraph,
                samples=settings.samples,
                seed=how.own_seed,
                subset=how.subset(),
                geometry=how.geometry,
                light=how.light,
            )
    except Cancelled:
        finish_samples(engine, layer_name, request)
        raise
    if clock.samples:  # where Cycles stopped before the most it was allowed
        how = replace(how, count=min(clock.samples, how.count))
    frames = {
        view: light_of(how, how.cameras[view], samples)
        for view, samples in noisy.items()
    }
    return frames, {"sync": clock.sync, "beauty": clock.render}


def _frames_of_halves(
    engine: Any, depsgraph: Any, how: Sampling
) -> tuple[dict[str, Frame], dict[str, float]]:
    """Render a frame in two halves; under motion blur its motion beside them."""
    motion: dict[str, Passes] = {}
    seconds = dict.fromkeys(("sync", "beauty"), 0.0)
    if how.needs_motion:
        motion, seconds = sample_motion(engine, depsgraph, how.own_seed)
    halves, more = sample_halves(engine, depsgraph, how.first, how.geometry, how.light)
    frames = {}
    for view, half in halves.items():
        samples = half.whole
        if view in motion:
            still = motion[view]
            samples = replace(samples, depth=still.depth, vector=still.vector)
        if samples.counts is not None:
            samples = replace(samples, counts=samples.counts / np.float32(how.count))
        frame = light_of(how, how.cameras[view], samples)
        frames[view] = replace(frame, halves=half.halves)
    return frames, {stage: seconds[stage] + more[stage] for stage in seconds}


def first_sample(engine: Any, depsgraph: Any, request: Request, place: int) -> None:
    """Render the first sample of the sequence that a frame continues.

    The result then holds its passes. `place` is as in `sampling_of`.
    """
    how = sampling_of(engine, depsgraph, request, place)
    subset = how.subset()
    assert subset is not None
    sample_layer(engine, depsgraph, subset=replace(subset, offset=0, length=1))


def light_of(how: Sampling, camera: Camera, samples: Passes) -> Frame:
    """One view's samples as accumulation takes them."""
    assert samples.depth is not None
    depth = samples.depth
    if how.has_length:
        height, width = depth.shape
        depth = depth * camera.depth_per_length((height, width))
    counts = samples.counts
    if counts is not None:
        counts = counts * np.float32(how.count)
    return Frame.of(
        samples,
        number=how.number,
        camera=camera,
        depth=depth,
        counts=counts,
        samples=how.count if counts is None else max(float(counts.mean()), _FEWEST),
        still=how.still,
        subset=how.shared,
    )


def _geometry(depsgraph: Any) -> Sequence[tuple[str, str]]:
    """The passes for reprojection; motion only where things may move.

    Cycles gives no vectors with motion blur.
    """
    blurred = depsgraph.scene_eval.render.use_motion_blur
    return GEOMETRY[:1] if blurred or not shapes_move(depsgraph) else GEOMETRY
