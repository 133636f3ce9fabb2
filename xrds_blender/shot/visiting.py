"""Going to other frames while one is rendered, as Blender goes from one to the next.

Scripts may set a scene up for each frame just before it is rendered, in `render_pre`.
Blender calls them for the frame that it asks for; frames ahead of it are sampled in the
same render, so here they are called for these.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

_ADD_ON = __name__.partition(".")[0]


def go_to(engine: Any, depsgraph: Any, number: int) -> None:
    """Evaluate another frame; nothing where the dependency graph is there already."""
    scene = depsgraph.scene_eval
    if number == scene.frame_current:
        return
    scene = scene.original
    engine.frame_set(number, 0.0)
    handlers = _scripts()
    for handler in handlers:
        _call(handler, scene)
    if handlers:  # what they changed is evaluated as well
        engine.frame_set(number, 0.0)


def _scripts() -> list[Callable[..., Any]]:
    """What others than this add-on have Blender call before a frame is rendered."""
    import bpy

    ours = f"{_ADD_ON}."
    handlers = bpy.app.handlers.render_pre
    return [x for x in handlers if not getattr(x, "__module__", "").startswith(ours)]


def _call(handler: Callable[..., Any], scene: Any) -> None:
    """As Blender does: with one argument or two; an error is reported, no more."""
    code = getattr(handler, "__code__", None)
    arguments = [scene] if code and code.co_argcount == 1 else [scene, None]
    try:
        handler(*arguments)
    except Exception:  # of somebody else's code
        traceback.print_exc()
