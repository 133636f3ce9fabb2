"""The plan of a picture before it is rendered."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..cycles.view import picture_size
from ..planning.estimates import resolved, shot_memory
from ..planning.offers import Offers, cycles_line, in_english, offer_line, source_line
from ..planning.plan import Strength, deadline, neighbours, same_picture
from ..planning.request import Request
from ..scene.contents import frame_range
from ..scene.remarks import remarks
from ..scene.strength import is_keyed, strength_of, weak_objects
from .advice import advice
from .blender_job import call_engine
from .facts import find_facts
from .history import scene_settings, seconds
from .modes import offers_of
from .pace.obstacles import can_save
from .sampling import has_neighbours
from .time_budget import Timed, in_time


def explain(
    scene: Any, request: Request, frames: Sequence[int] | None = None
) -> dict[str, Any]:
    """Facts and decisions of the first of some frames, evaluated as for its render.

    `frames` None is the scene's current one, and its whole range as a shot. Nothing is
    rendered but, for a still with a time budget, the tries that a render would choose
    by. Raises SceneError without a camera.
    """
    start = time.perf_counter()
    if frames:
        scene.frame_set(frames[0])
    shot = frames or frame_range(scene)

    def look(engine: Any, depsgraph: Any) -> dict[str, Any]:
        is_shot = len(shot) > 1 and has_neighbours(scene, request)
        wanted = request.in_shot(len(shot)) if is_shot else request
        with in_time(engine, depsgraph, wanted, start) as timed:
            return _described(depsgraph, timed, scene, shot)

    return call_engine(scene, look)


def _described(
    depsgraph: Any, timed: Timed, scene: Any, shot: Sequence[int]
) -> dict[str, Any]:
    request, radius = timed.request, timed.request.settings.temporal_radius
    is_shot = len(shot) > 1
    facts = find_facts(depsgraph, request.settings)
    decisions = (*timed.decisions, *request.plan(facts).decisions)
    if radius and is_shot:
        decisions += neighbours(facts, radius, _strength(depsgraph, request))
    if can_save(scene, request, len(shot)):
        decisions += (same_picture(scene.cycles.samples),)
    if request.deadline is not None:
        decisions += (deadline(request.deadline, len(shot)),)
    size = picture_size(scene.render)
    pace = request.deadline and request.deadline / len(shot)
    settings = resolved(request.settings, scene_settings(scene))
    found = offers_of(scene, request, len(shot)) if is_shot else None
    lines = advice(scene, facts.scene, request, shot)
    return {
        "frames": len(shot),
        "seconds": pace or seconds(scene, settings, radius if is_shot else 0),
        "memory": shot_memory(*size, radius, settings.scale) if is_shot else 0,
        "facts": asdict(facts),
        "decisions": [asdict(each) for each in decisions],
        "offers": [asdict(offer) for offer in found.offers] if found else [],
        "summary": _summary(found) if found else [],
        "remarks": [
            *(in_english(text, **values) for text, values in lines),
            *remarks(scene, request),
        ],
    }


def _summary(found: Offers) -> list[str]:
    """What the animation takes, and what XRDS offers: the lines of the panel."""
    offered = (offer_line(offer, found.animation) for offer in found.offers)
    return [cycles_line(found), *offered, source_line(found)]


def _strength(depsgraph: Any, request: Request) -> Strength:
    scene, weak = depsgraph.scene_eval, weak_objects(depsgraph.ids)
    return Strength(
        strength_of(scene, request),
        is_keyed(scene, request),
        {item.name: item.xrds_strength for item in weak},
    )
