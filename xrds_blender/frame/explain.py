"""The plan of a picture before it is rendered."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Any

from ..cycles.passes import CyclesPasses
from ..planning.lending import lending
from ..planning.plan import Decision
from ..scene.cuts import cuts
from .facts import find_facts
from .job import RenderJob
from .picking import pick, picked_decisions
from .rendering import call_engine


def explain(scene: Any, job: RenderJob) -> dict[str, Any]:
    """Facts and decisions of a scene, evaluated as for a render.

    Nothing is rendered but, for a time budget or a quality, the probes that a render
    would choose by. Raises SceneError without a camera.
    """
    start = time.perf_counter()

    def look(engine: Any, depsgraph: Any) -> dict[str, Any]:
        if not job.is_picked:
            return _told(scene, depsgraph, job)
        with CyclesPasses(engine, depsgraph) as passes:
            picked, decision = pick(passes, job, start)
            return _told(scene, depsgraph, picked, decision)

    return call_engine(scene, look)


def _told(
    scene: Any, depsgraph: Any, job: RenderJob, choice: Decision | None = None
) -> dict[str, Any]:
    facts = find_facts(depsgraph, job)
    decisions = job.plan(facts).decisions
    if job.temporal_radius:
        frames = range(scene.frame_start, scene.frame_end + 1)
        decisions += lending(facts, job.temporal_radius, cuts(scene, frames))
    if choice is not None:
        decisions = picked_decisions(job, choice, decisions)
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}
