"""What the panel knows of a scene: looked at after a change, never while it draws.

To look at a scene of thousands of objects takes longer than a drawing may. So that
waits until no change has come for a while, the longer the more it takes; small scenes
are looked at at once.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy

from ...internals.lifetimes import FILE
from ...planning.request import Request
from ...planning.settings import Settings
from ...rendering.sampling import has_neighbours

if TYPE_CHECKING:
    from ...planning.plan import Facts, SceneFacts
    from ...rendering.advice import Line

_SMALL = 200  # objects of a file that is looked at at once
# Seconds without a change, and how many times as long as a look took.
_QUIET, _LONGER = 0.5, 20.0


@dataclass(frozen=True)
class Seen:
    """What was found in a scene: its facts, and lines on its shot and on all of it."""

    facts: SceneFacts
    of_shot: tuple[Line, ...]
    of_scene: tuple[Line, ...]


@dataclass
class _Cache:
    """By scene and view layer; `stale` ones are looked at again."""

    seen: dict[tuple[str, str], Seen] = field(default_factory=dict)
    stale: set[tuple[str, str]] = field(default_factory=set)
    wanted: set[tuple[str, str]] = field(default_factory=set)
    changed: float = 0.0
    quiet: float = _QUIET


def forget() -> None:
    """Something in a scene has changed."""
    cache = FILE.of(_Cache)
    cache.stale.update(cache.seen)
    cache.changed = time.perf_counter()


def seen(scene: Any, layer: Any) -> Seen | None:
    """What is known of a scene; None where it was not looked at yet."""
    cache, key = FILE.of(_Cache), (scene.name, layer.name)
    if key not in cache.seen or key in cache.stale:
        if bpy.app.background or len(bpy.data.objects) <= _SMALL:
            _look(scene, layer)
        else:
            cache.wanted.add(key)
            if not bpy.app.timers.is_registered(_look_later):
                bpy.app.timers.register(_look_later, first_interval=cache.quiet)
    return cache.seen.get(key)


def facts(scene: Any, layer: Any, settings: Settings) -> Facts:
    """Facts of a scene as the viewport shows it."""
    from ...planning.plan import SceneFacts
    from ...rendering.facts import join_facts

    known = seen(scene, layer)
    return join_facts(scene, settings, known.facts if known else SceneFacts())


def is_animation(scene: Any) -> bool:
    """Whether the scene's range has several frames, and something changes in them."""
    if scene.frame_end <= scene.frame_start:
        return False
    known = seen(scene, scene.view_layers[0])
    return known is not None and bool(known.facts.moving)


def is_shot(scene: Any, request: Request) -> bool:
    """Whether it is an animation whose frames use each other's samples."""
    return is_animation(scene) and has_neighbours(scene, request)


def _look(scene: Any, layer: Any) -> None:
    """Look at a scene now."""
    from ...planning.plan import SceneFacts
    from ...rendering.advice import advice_of_scene, advice_of_shot
    from ...scene.contents import frame_range, scene_facts

    cache, key, graph = FILE.of(_Cache), (scene.name, layer.name), layer.depsgraph
    found = SceneFacts() if graph is None else scene_facts(graph)
    of_shot = advice_of_shot(scene, found, frame_range(scene)) if scene.camera else []
    cache.seen[key] = Seen(found, tuple(of_shot), tuple(advice_of_scene(scene)))
    cache.stale.discard(key)


def _look_later() -> float | None:
    """For Blender's timers: look at what was asked for, once it is quiet."""
    cache = FILE.of(_Cache)
    started = time.perf_counter()
    quiet = started - cache.changed
    if quiet < cache.quiet:
        return cache.quiet - quiet
    for scene_name, layer_name in cache.wanted:
        scene = bpy.data.scenes.get(scene_name)
        layer = scene and scene.view_layers.get(layer_name)
        if layer is not None:
            _look(scene, layer)
    cache.wanted.clear()
    cache.quiet = max(_QUIET, _LONGER * (time.perf_counter() - started))
    redraw()
    return None


def redraw() -> None:
    """Have Blender draw the panels again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
