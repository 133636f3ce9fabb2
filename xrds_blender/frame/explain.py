"""The plan of a picture before it is rendered."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from .facts import find_facts
from .job import RenderJob
from .rendering import evaluate


def explain(scene: Any, job: RenderJob) -> dict[str, Any]:
    """Facts and decisions of a scene, evaluated as for a render; nothing is rendered.

    Raises SceneError without a camera.
    """
    facts = evaluate(scene, lambda depsgraph: find_facts(depsgraph, job))
    decisions = job.plan(facts).decisions
    return {"facts": asdict(facts), "decisions": [asdict(each) for each in decisions]}
