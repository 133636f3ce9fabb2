"""The plan of a picture before it is rendered."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..planning.lending import lending
from ..scene.cuts import cuts
from .facts import find_facts
from .job import RenderJob
from .rendering import evaluate


def explain(scene: Any, job: RenderJob) -> dict[str, Any]:
    """Facts and decisions of a scene, evaluated as for a render; nothing is rendered.

    Raises SceneError without a camera.
    """
    facts = evaluate(scene, lambda depsgraph: find_facts(depsgraph, job))
    decisions = job.plan(facts).decisions
    if job.temporal_radius:
        frames = range(scene.frame_start, scene.frame_end + 1)
        decisions += lending(facts, job.temporal_radius, cuts(scene, frames))
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}
