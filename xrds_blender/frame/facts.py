"""What the plan of a frame rests on: facts of its scene, its job and this Blender."""

from __future__ import annotations

import os
from typing import Any

from ..cycles import low_camera, session
from ..cycles.size import frame_size
from ..cycles.view import can_track
from ..planning.facts import Facts, SceneFacts
from ..scene.facts import scene_facts
from . import denoisers
from .job import RenderJob

# Core-seconds of a million guide samples with nothing left out: docs/performance.md.
CORE_SECONDS = 4.8


def find_facts(depsgraph: Any, job: RenderJob) -> Facts:
    """The facts of a frame, from an evaluated scene."""
    return join_facts(depsgraph.scene_eval, job, scene_facts(depsgraph))


def join_facts(scene: Any, job: RenderJob, scene_facts: SceneFacts) -> Facts:
    """The facts of a frame, with those of its scene at hand."""
    width, height = frame_size(scene.render)
    camera = scene.camera
    return Facts(
        scale=job.scale,
        width=width,
        height=height,
        max_bounces=scene.cycles.max_bounces,
        has_denoiser=session.has_denoiser() or denoisers.is_there(),
        lends=camera is None or can_track(scene),
        exact_camera=camera is None or low_camera.is_exact(camera.data),
        guide_samples=job.guide_samples,
        scene=scene_facts,
        guide_seconds=_guide_seconds(scene, width * height * job.guide_samples),
    )


def _guide_seconds(scene: Any, samples: int) -> float | None:
    """Estimate of a whole guide render; None on a GPU, of which nothing is known."""
    if scene.cycles.device != "CPU":
        return None
    return CORE_SECONDS * samples / 1e6 / (os.cpu_count() or 1)
