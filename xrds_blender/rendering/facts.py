"""The facts of a frame that its plan rests on."""

from __future__ import annotations

import os
from typing import Any

from ..cycles import low_resolution, session
from ..cycles.view import can_track, frame_size
from ..planning.plan import Facts, SceneFacts
from ..planning.settings import Settings
from ..scene.contents import scene_facts
from . import loading

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
