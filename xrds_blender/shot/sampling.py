"""The noisy samples of one frame of a shot, packed for the window."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from xrds_core.errors import Cancelled, SceneError
from xrds_core.temporal.frame import Camera, Frame, store
from xrds_core.temporal.samples import Portion, continued

from ..cycles import session
from ..cycles.halves import sample_halves, sample_motion
from ..cycles.samples import COUNTS, GEOMETRY, LATE_DEPTH, Samples, sample_layer
from ..cycles.settings import has_subsets
from ..cycles.view import cameras_of
from ..frame import progress
from ..frame.job import RenderJob
from ..frame.stopping import keep_samples
from ..scene.facts import scene_facts, shapes_move, stands_still

# Frames of one seed would have the same noise, and gain nothing from each other.
SEED_STEP = 7919
LARGEST_SEED = 2**31 - 1
_FEWEST = 1.0  # samples, on the mean of a frame


Keep = Callable[[Mapping[str, Frame]], object]
"""Takes a frame's samples by view, to be used another time."""


@dataclass(frozen=True)
class Sampled:
    """One frame as the window keeps it, by view, and the seconds that it took.

    Views are `Stored` at full size, `enlarged.View` above scale 1.
    """

    views: dict[str, Any]
    seconds: dict[str, float]

    def lenders(self, view: str, frames: Sequence[Sampled]) -> list[Any]:
        """What lends to a view: that view of other frames, and this frame's others."""
        beside = [each for name, each in self.views.items() if name != view]
        return [each.views[view] for each in frames if view in each.views] + beside


@dataclass(frozen=True)
class Sampling:
    """How a frame of a shot is sampled, and the cameras that see it, by view.

    `count` samples per pixel; `geometry` names passes. `place` is the frame's in the
    shot where frames continue one sequence, None where each begins its own. `still`
    is as in `Frame`. A frame that `has_halves` is sampled in two; one that
    `needs_motion` is rendered once more without motion blur, to tell it.
    """

    number: int
    cameras: dict[str, Camera]
    count: int
    seed: int
    geometry: Sequence[tuple[str, str]] = GEOMETRY
    place: int | None = None
    radius: int = 0
    still: bool = False
    has_halves: bool = False
    needs_motion: bool = False

    def portion(self, count: int, other: int = 0) -> Portion | None:
        """The frame's part, of `count` samples, of the sequence it continues.

        `other` sequences have other seeds. None where each frame begins its own.
        """
        if self.place is None:
            return None
        return continued(self.place, count, self.radius, self.seed + other)

    @property
    def own_seed(self) -> int:
        """One that no other frame has."""
        return (self.seed + self.number * SEED_STEP) % LARGEST_SEED


def can_continue(scene: Any, job: RenderJob) -> bool:
    """Whether frames can take parts of one sequence: where pixels stand still.

    And where the file does not let Cycles decide how many samples a pixel takes.
    """
    return stands_still(scene.camera) and has_subsets(scene) and _is_even(scene, job)


def sampling_of(
    engine: Any, depsgraph: Any, job: RenderJob, place: int | None
) -> Sampling:
    """How the frame that the dependency graph is at is to be sampled.

    `place`, the frame's in the shot, lets frames under a camera that stands still
    continue one sequence; passes of its first sample alone, as Depth, are empty in the
    result then. Raises SceneError under a camera that no matrix describes.
    """
    scene = depsgraph.scene_eval
    cameras = cameras_of(engine, depsgraph)
    if not cameras:
        raise SceneError("such panoramas lend nothing; set the temporal radius to 0")
    is_even = _is_even(scene, job)
    if not job.temporal_radius or not can_continue(scene, job):
        place = None
    geometry = [*_geometry(depsgraph), *([] if is_even else [COUNTS])]
    count = job.samples or session.samples_of(depsgraph)
    blurred = scene.render.use_motion_blur
    return Sampling(
        number=scene.frame_current,
        cameras=cameras,
        count=count,
        seed=scene.cycles.seed if job.seed is None else job.seed,
        geometry=geometry if place is None else [LATE_DEPTH, *geometry[1:]],
        place=place,
        radius=job.temporal_radius,
        still=not scene_facts(depsgraph).moving,
        has_halves=_has_halves(scene, job, count),
        needs_motion=blurred and shapes_move(depsgraph),
    )


def _is_even(scene: Any, job: RenderJob) -> bool:
    """Whether every pixel takes as many samples as it is asked to."""
    cycles = scene.cycles
    decides = cycles.use_adaptive_sampling or cycles.time_limit
    return job.samples is not None or not decides


def _has_halves(scene: Any, job: RenderJob, count: int) -> bool:
    """Whether a frame's samples can be had in two halves that add up to all."""
    if count < 2 or not job.temporal_radius or not has_subsets(scene):
        return False
    cycles = scene.cycles
    return job.samples is not None or not (
        cycles.use_sample_subset or cycles.time_limit
    )


def sample_frame(
    engine: Any,
    depsgraph: Any,
    job: RenderJob,
    place: int | None = None,
    keep: Keep | None = None,
) -> Sampled:
    """Render a frame as `noisy_frame` does and pack it for the window.

    `keep` takes its views before that.
    """
    frames, seconds = noisy_frame(engine, depsgraph, job, place)
    if keep is not None:
        keep(frames)
    views = {view: store(frame, np.float16) for view, frame in frames.items()}
    return Sampled(views, dict.fromkeys(progress.STAGES, 0.0) | seconds)


def noisy_frame(
    engine: Any, depsgraph: Any, job: RenderJob, place: int | None = None
) -> tuple[dict[str, Frame], dict[str, float]]:
    """Render the frame that the dependency graph is at; the result holds its passes.

    Returns its samples by view, and the seconds of the stages. Every frame has samples
    of its own, whatever the file's seed says; `place` is as in `sampling_of`. Raises
    Cancelled when the user stops it, and what `sampling_of` does.
    """
    how = sampling_of(engine, depsgraph, job, place)
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    progress.begin(engine, f"{progress.SAMPLES} of frame {how.number}", 1, 2)
    try:
        if how.has_halves:
            return _frames_of_halves(engine, depsgraph, how)
        noisy, clock = sample_layer(
            engine,
            depsgraph,
            samples=job.samples,
            seed=how.own_seed,
            portion=how.portion(how.count),
            geometry=how.geometry,
        )
    except Cancelled:
        keep_samples(engine, layer_name, job)
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
    motion, seconds = {}, dict.fromkeys(("sync", "beauty"), 0.0)
    if how.needs_motion:
        motion, seconds = sample_motion(engine, depsgraph, how.own_seed)
    portion = how.portion(how.count) or Portion(how.own_seed, how.count, 0, how.count)
    found, more = sample_halves(engine, depsgraph, portion, how.geometry)
    frames = {}
    for view, half in found.items():
        samples = half.whole
        if view in motion:
            still = motion[view]
            samples = replace(samples, depth=still.depth, vector=still.vector)
        if samples.counts is not None:
            samples = replace(samples, counts=samples.counts / np.float32(how.count))
        frame = light_of(how, how.cameras[view], samples)
        frames[view] = replace(frame, halves=half.halves)
    return frames, {stage: seconds[stage] + more[stage] for stage in seconds}


def first_sample(engine: Any, depsgraph: Any, job: RenderJob, place: int) -> None:
    """Render the first sample of the sequence that a frame continues.

    The result then holds its passes. `place` is as in `sampling_of`.
    """
    how = sampling_of(engine, depsgraph, job, place)
    portion = how.portion(how.count)
    assert portion is not None
    sample_layer(engine, depsgraph, portion=replace(portion, offset=0, length=1))


def light_of(how: Sampling, camera: Camera, samples: Samples) -> Frame:
    """One view's samples as accumulation takes them."""
    assert samples.depth is not None
    counts = samples.counts
    if counts is not None:
        counts = counts * np.float32(how.count)
    return Frame(
        number=how.number,
        camera=camera,
        radiance=samples.picture[..., :3],
        alpha=samples.picture[..., 3],
        albedo=samples.albedo,
        normal=samples.normal,
        depth=samples.depth,
        vector=samples.vector,
        samples=how.count if counts is None else max(float(counts.mean()), _FEWEST),
        still=how.still,
        counts=counts,
    )


def _geometry(depsgraph: Any) -> Sequence[tuple[str, str]]:
    """The passes that tell where pixels were; motion only where things may move.

    Cycles gives no vectors with motion blur.
    """
    blurred = depsgraph.scene_eval.render.use_motion_blur
    return GEOMETRY[:1] if blurred or not shapes_move(depsgraph) else GEOMETRY
