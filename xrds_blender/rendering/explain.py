"""The plan of a picture before it is rendered."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..cycles.view import picture_size
from ..planning.estimates import resolved, shot_memory
from ..planning.plan import deadline, neighbours, same_picture
from ..planning.request import Request
from ..scene.contents import cuts, frame_range
from ..scene.remarks import remarks
from .blender_job import call_engine
from .choose import Chosen, chosen, find_facts, frame_seconds
from .history import scene_settings
from .pace.same_picture import can_save
from .sampling import has_neighbours


def explain(
    scene: Any, request: Request, frames: Sequence[int] | None = None
) -> dict[str, Any]:
    """Facts and decisions of the first of some frames, evaluated as for its render.

    `frames` None is the scene's current one, and its whole range as a shot. Nothing is
    rendered but, for a time budget or a quality, the probes that a render would choose
    by. Raises SceneError without a camera.
    """
    start = time.perf_counter()
    if frames:
        scene.frame_set(frames[0])
    shot = frames or frame_range(scene)

    def look(engine: Any, depsgraph: Any) -> dict[str, Any]:
        is_shot = len(shot) > 1 and has_neighbours(scene, request)
        with chosen(engine, depsgraph, request, start, is_shot) as found:
            return _described(depsgraph, found, scene, shot)

    return call_engine(scene, look)


def _described(
    depsgraph: Any, choice: Chosen, scene: Any, shot: Sequence[int]
) -> dict[str, Any]:
    request, radius = choice.request, choice.request.settings.temporal_radius
    facts = find_facts(depsgraph, request.settings)
    decisions = request.plan(facts).decisions
    if radius and len(shot) > 1:
        decisions += neighbours(facts, radius, cuts(scene, shot))
    if can_save(scene, request, len(shot)):
        decisions += (same_picture(scene.cycles.samples),)
    if request.deadline is not None:
        decisions += (deadline(request.deadline, len(shot)),)
    decisions = choice.all_decisions(decisions)
    size = picture_size(scene.render)
    pace = request.deadline and request.deadline / len(shot)
    settings = resolved(request.settings, scene_settings(scene))
    return {
        "frames": len(shot),
        "seconds": pace or frame_seconds(scene, settings, radius),
        "memory": shot_memory(*size, radius, settings.scale) if len(shot) > 1 else 0,
        "facts": asdict(facts),
        "decisions": [asdict(each) for each in decisions],
        "remarks": remarks(scene, request),
    }
