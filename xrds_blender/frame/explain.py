"""The plan of a picture before it is rendered."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..cycles.passes import CyclesPasses
from ..planning.lending import lending
from ..scene.cuts import cuts
from .facts import find_facts
from .job import RenderJob
from .lending import can_lend
from .picking import Pick, pick, picked_decisions
from .rendering import call_engine


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
        if not job.is_picked:
            return _told(depsgraph, job, scene, shot)
        lends = len(shot) > 1 and can_lend(scene, job)
        with CyclesPasses(engine, depsgraph) as passes:
            picked = pick(passes, job, start, shot=lends)
            return _told(depsgraph, picked.job, scene, shot, picked)

    return call_engine(scene, look)


def _told(
    depsgraph: Any,
    job: RenderJob,
    scene: Any,
    shot: Sequence[int],
    picked: Pick | None = None,
) -> dict[str, Any]:
    facts = find_facts(depsgraph, job)
    decisions = job.plan(facts).decisions
    if job.temporal_radius and len(shot) > 1:
        decisions += lending(facts, job.temporal_radius, cuts(scene, shot))
    if picked is not None:
        decisions = picked_decisions(picked, decisions)
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}
