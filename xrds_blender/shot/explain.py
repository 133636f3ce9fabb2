"""The plan of a picture before it is rendered."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..frame.facts import find_facts
from ..frame.job import RenderJob
from ..frame.rendering import call_engine
from ..planning.lending import lending
from ..scene.cuts import cuts
from .choosing import ChosenJob, chosen
from .sampling import has_neighbours


def explain(
    scene: Any, job: RenderJob, frames: Sequence[int] | None = None
) -> dict[str, Any]:
    """Facts and decisions of the first of some frames, evaluated as for its render.

    `frames` None is the scene's current one, and its whole range as a shot. Nothing is
    rendered but, for a time budget or a quality, the probes that a render would choose
    by. Raises SceneError without a camera.
    """
    start = time.perf_counter()
    if frames:
        scene.frame_set(frames[0])
    shot = frames or range(scene.frame_start, scene.frame_end + 1)

    def look(engine: Any, depsgraph: Any) -> dict[str, Any]:
        is_shot = len(shot) > 1 and has_neighbours(scene, job)
        with chosen(engine, depsgraph, job, start, is_shot) as found:
            return _told(depsgraph, found, scene, shot)

    return call_engine(scene, look)


def _told(
    depsgraph: Any, choice: ChosenJob, scene: Any, shot: Sequence[int]
) -> dict[str, Any]:
    job = choice.job
    facts = find_facts(depsgraph, job)
    decisions = job.plan(facts).decisions
    if job.temporal_radius and len(shot) > 1:
        decisions += lending(facts, job.temporal_radius, cuts(scene, shot))
    decisions = choice.all_decisions(decisions)
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}
