"""The plan of a picture before it is rendered: for `--explain` and for the panel."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import cycles_session, low_camera
from .facts import Facts, SceneFacts
from .scene_facts import scene_facts

if TYPE_CHECKING:
    from .job import RenderJob

# Core-seconds of a million guide samples with nothing left out: docs/performance.md.
CORE_SECONDS = 4.8


def find_facts(depsgraph: Any, job: RenderJob) -> Facts:
    """What the plan of a frame rests on, from an evaluated scene."""
    return _facts(depsgraph.scene_eval, job, scene_facts(depsgraph))


def explain_file(
    path: Path, job: RenderJob, *, resolution: tuple[int, int] | None = None
) -> dict[str, Any]:
    """What `xrds plan SCENE --json` prints: facts and decisions, nothing rendered.

    Raises SceneError if Blender cannot read the file or it has no camera.
    """
    from .render_file import open_scene

    scene = open_scene(path)
    if resolution:
        scene.render.resolution_x, scene.render.resolution_y = resolution
        scene.render.resolution_percentage = 100
    return explain(scene, job)


def explain(scene: Any, job: RenderJob) -> dict[str, Any]:
    """Facts and decisions of a scene, evaluated as for a render."""
    from .render import evaluate

    facts = evaluate(scene, lambda depsgraph: find_facts(depsgraph, job))
    decisions = job.plan(facts).decisions
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}


class Glance:
    """Facts for a panel, which is drawn often: found anew only after a change."""

    def __init__(self) -> None:
        self._known: dict[str, SceneFacts] = {}

    def forget(self, *_: Any) -> None:
        """For Blender's handlers: something has changed."""
        self._known.clear()

    def facts(self, scene: Any, layer: Any, job: RenderJob) -> Facts:
        """Facts of a scene as the viewport shows it."""
        graph = layer.depsgraph
        if graph is None:
            return _facts(scene, job, SceneFacts())
        name = f"{scene.name} {layer.name}"
        if name not in self._known:
            self._known[name] = scene_facts(graph)
        return _facts(scene, job, self._known[name])


def _facts(scene: Any, job: RenderJob, found: SceneFacts) -> Facts:
    render, camera = scene.render, scene.camera
    width, height = (
        int(size * render.resolution_percentage / 100)
        for size in (render.resolution_x, render.resolution_y)
    )
    return Facts(
        scale=job.scale,
        width=width,
        height=height,
        guides=job.guides,
        max_bounces=scene.cycles.max_bounces,
        has_denoiser=cycles_session.has_denoiser(),
        exact_camera=camera is None or low_camera.is_exact(camera.data),
        guide_samples=job.guide_samples,
        scene=found,
        guide_seconds=_guide_seconds(scene, width * height * job.guide_samples),
    )


def _guide_seconds(scene: Any, samples: int) -> float | None:
    """Estimate of a whole guide render; None on a GPU, of which nothing is known."""
    if scene.cycles.device != "CPU":
        return None
    return CORE_SECONDS * samples / 1e6 / (os.cpu_count() or 1)
