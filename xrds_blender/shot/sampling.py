"""The noisy samples of one frame of a shot, packed for the window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from xrds_core.errors import SceneError
from xrds_core.temporal.frame import Camera, Frame, Stored, store
from xrds_core.temporal.samples import continued

from ..cycles.samples import GEOMETRY, LATE_DEPTH, Samples, sample_layer
from ..cycles.view import camera_of
from ..frame import progress
from ..frame.job import RenderJob
from ..scene.facts import scene_facts, stands_still

# Frames of one seed would have the same noise, and gain nothing from each other.
SEED_STEP = 7919
LARGEST_SEED = 2**31 - 1


@dataclass(frozen=True)
class Sampled:
    """One frame as the window keeps it, by view, and the seconds that it took."""

    views: dict[str, Stored]
    seconds: dict[str, float]


def can_lend(scene: Any) -> bool:
    """Whether frames can lend to each other: not under a panoramic camera."""
    return scene.camera is not None and scene.camera.data.type in {"PERSP", "ORTHO"}


def sample_frame(
    engine: Any, depsgraph: Any, job: RenderJob, place: int | None = None
) -> Sampled:
    """Render a frame as `noisy_frame` does and pack it for the window."""
    frames, seconds = noisy_frame(engine, depsgraph, job, place)
    views = {view: store(frame, np.float16) for view, frame in frames.items()}
    return Sampled(views, dict.fromkeys(progress.STAGES, 0.0) | seconds)


def noisy_frame(
    engine: Any, depsgraph: Any, job: RenderJob, place: int | None = None
) -> tuple[dict[str, Frame], dict[str, float]]:
    """Render the frame that the dependency graph is at; the result holds its passes.

    Returns its samples by view, and the seconds of the stages. Every frame has a seed
    of its own, whatever the file says. `place`, the frame's in the shot, lets frames
    under a camera that stands still continue one sequence instead; passes of its first
    sample alone, as Depth, are empty in the result then.
    Raises Cancelled when the user stops it, SceneError under a camera that no matrix
    describes.
    """
    scene = depsgraph.scene_eval
    number, count = scene.frame_current, job.samples or scene.cycles.samples
    seed = scene.cycles.seed if job.seed is None else job.seed
    camera = camera_of(depsgraph, engine.path_resolve("render"))
    if camera is None:
        raise SceneError("a panorama has no neighbours; set the temporal radius to 0")
    portion, geometry = None, _geometry(depsgraph)
    if place is not None and job.temporal_radius and _is_continued(depsgraph):
        portion = continued(place, count, job.temporal_radius, seed)
        geometry = [LATE_DEPTH, *geometry[1:]]
    noisy, clock = sample_layer(
        engine,
        depsgraph,
        samples=job.samples,
        seed=(seed + number * SEED_STEP) % LARGEST_SEED,
        portion=portion,
        geometry=geometry,
    )
    frames = {
        view: _frame(number, camera, samples, count) for view, samples in noisy.items()
    }
    return frames, {"sync": clock.sync, "beauty": clock.render}


def _is_continued(depsgraph: Any) -> bool:
    """Whether frames meet pixel on pixel, so that one sequence serves them all."""
    scene = depsgraph.scene_eval
    cut = any(marker.camera for marker in scene.timeline_markers)
    return not cut and stands_still(scene.camera)


def _geometry(depsgraph: Any) -> Sequence[tuple[str, str]]:
    """The passes that tell where pixels were; motion only where things may move.

    Cycles gives no vectors with motion blur. A moving camera alone needs none.
    """
    scene = depsgraph.scene_eval
    facts = scene_facts(depsgraph)
    camera = {scene.camera.name, scene.camera.data.name}
    if facts.motion_blur or set(facts.moving) <= camera:
        return GEOMETRY[:1]
    return GEOMETRY


def _frame(number: int, camera: Camera, samples: Samples, count: int) -> Frame:
    assert samples.depth is not None
    return Frame(
        number=number,
        camera=camera,
        radiance=samples.picture[..., :3],
        alpha=samples.picture[..., 3],
        albedo=samples.albedo,
        normal=samples.normal,
        depth=samples.depth,
        vector=samples.vector,
        samples=count,
    )
