"""One render by XRDS of a scene that keeps its own render engine.

At the start of a render Blender calls `render_init`, copies the scene's render settings
and calls `render_pre`; from then on it looks at the copy alone. So XRDS' name stands in
the scene between these two calls only, and nobody sees it: a file saved, an undo step
or a panel drawn while the render runs has the scene's own engine. The name is written
in place: Blender's property would restart viewports, and only the main thread may set
it.

With persistent data Blender keeps the engine, and with it the synced scene, for the
next render of the scene, whoever is asked for it. So ours is kept for our next one, and
freed before one by another engine.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import bpy

from xrds_core.errors import SceneError

from .lifetimes import PROCESS

ENGINE = "XRDS"
"""Blender's name for the render engine."""

_NAME_SIZE = 32  # bytes that Blender keeps for the name
_MOST = 1 << 16  # bytes of the render settings, far more than they are


@dataclass
class Override:
    """Which scene is, or will be, rendered by XRDS in the place of its own engine.

    `offset` is where the name lies in the render settings, the same in every scene.
    `waiting` is the scene whose next render is to be ours; `named` the one that bears
    our name now, with the bytes of its own; `last` that of the render that goes on.
    `kept` is the session identifier of the scene whose engine Blender keeps, if that is
    ours.
    """

    offset: int | None = None
    waiting: Any = None
    named: tuple[Any, bytes] | None = None
    last: Any = None
    kept: int | None = None


def begin(scene: Any) -> None:
    """Let the render of `scene` that is started next be by XRDS.

    To be called on the main thread. Raises SceneError where this Blender keeps the
    name in an unknown way; nothing is changed then.
    """
    if scene.render.engine != ENGINE:
        _find(scene.render)
        state = PROCESS.of(Override)
        if state.kept != scene.session_uid:
            _free_last_engine(scene)
        state.waiting = scene


def withdraw() -> None:
    """The render has ended, or none has begun: the next one is not to be ours."""
    PROCESS.of(Override).waiting = None


@bpy.app.handlers.persistent
def _before_copy(scene: Any, *_: Any) -> None:
    state = PROCESS.of(Override)
    if state.waiting is not None and scene == state.waiting:
        address = _find(scene.render)
        state.named = scene, ctypes.string_at(address, _NAME_SIZE)
        state.last, state.waiting = scene, None
        ctypes.memmove(address, _padded(ENGINE), _NAME_SIZE)
    elif state.kept == scene.session_uid:
        _free_last_engine(scene)


@bpy.app.handlers.persistent
def _after_copy(*_: Any) -> None:
    state = PROCESS.of(Override)
    if state.named is not None:
        (scene, own), state.named = state.named, None
        ctypes.memmove(_find(scene.render), own, _NAME_SIZE)


@bpy.app.handlers.persistent
def _at_end(*_: Any) -> None:
    _after_copy()  # where nothing could be rendered it has not been called
    state = PROCESS.of(Override)
    if state.last is not None:
        scene, state.last = state.last, None
        state.kept = scene.session_uid


@bpy.app.handlers.persistent
def _at_cancel(*_: Any) -> None:
    scene = PROCESS.of(Override).last
    _at_end()
    if scene is not None:
        _free_last_engine(scene)  # in whatever state it was stopped


def _free_last_engine(scene: Any) -> None:
    """Free what Blender keeps of the last render, which may be another engine's."""
    PROCESS.of(Override).kept = None
    if scene.render.use_persistent_data:
        scene.render.use_persistent_data = False
        scene.render.use_persistent_data = True


def _find(render: Any) -> int:
    """The address of the engine's name in render settings; raises SceneError."""
    state, base = PROCESS.of(Override), render.as_pointer()
    if state.offset is None:
        state.offset = _look_for(render)
    at = state.offset
    if at is None or ctypes.string_at(base + at) != render.engine.encode():
        raise SceneError(
            f"Blender {bpy.app.version_string} keeps the name of a scene's render "
            "engine in a way that XRDS does not know; choose the engine XRDS instead"
        )
    return base + at


def _look_for(render: Any) -> int | None:
    """Try every place that holds the name until the property follows."""
    # Both lie in the scene; what is between them may be read.
    base, end = render.as_pointer(), render.id_data.view_settings.as_pointer()
    if not _NAME_SIZE < end - base < _MOST:
        return None
    memory, name = ctypes.string_at(base, end - base), _padded(render.engine)
    name = name.rstrip(b"\0") + b"\0"
    at = memory.find(name)
    while 0 <= at <= len(memory) - _NAME_SIZE:
        old = memory[at : at + _NAME_SIZE]
        ctypes.memmove(base + at, _padded(ENGINE), _NAME_SIZE)
        follows = render.engine == ENGINE
        ctypes.memmove(base + at, old, _NAME_SIZE)
        if follows:
            return at
        at = memory.find(name, at + 1)
    return None


def _padded(name: str) -> bytes:
    return name.encode().ljust(_NAME_SIZE, b"\0")


def register() -> None:
    """Listen to Blender's renders."""
    handlers = bpy.app.handlers
    handlers.render_init.append(_before_copy)
    handlers.render_pre.insert(0, _after_copy)
    handlers.render_complete.append(_at_end)
    handlers.render_cancel.append(_at_cancel)


def unregister() -> None:
    """Listen no more; what Blender keeps of our renders is freed."""
    for scene in bpy.data.scenes:
        if scene.session_uid == PROCESS.of(Override).kept:
            _free_last_engine(scene)
    handlers = bpy.app.handlers
    handlers.render_init.remove(_before_copy)
    handlers.render_pre.remove(_after_copy)
    handlers.render_complete.remove(_at_end)
    handlers.render_cancel.remove(_at_cancel)
