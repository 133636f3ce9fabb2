"""Everything that Blender has to know, registered in order and taken back."""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from typing import Any

import bpy

from ..cycles import session
from ..internals import engine_override
from ..internals.lifetimes import PROCESS, RENDER_JOB
from . import (
    denoise_files,
    engine,
    live_picture,
    operators,
    preferences,
    properties,
    thread_guard,
    try_frame,
)
from .panel import panels


@dataclass
class _State:
    is_registered: bool = False
    ends_by_itself: bool = False  # before the interpreter does


def register(package: str = "xrds_blender") -> None:
    """Register engine, settings, preferences, operators and panels.

    `package` is the add-on's module name, under which Blender keeps its preferences.
    """
    session.functions()
    bpy.utils.register_class(properties.XRDSSettings)
    bpy.types.Scene.xrds = bpy.props.PointerProperty(type=properties.XRDSSettings)
    bpy.types.Object.xrds_strength = properties.OBJECT_STRENGTH
    bpy.utils.register_class(engine.XRDSRender)
    engine_override.register()  # before those who ask for a scene's engine
    thread_guard.register()
    live_picture.register()
    preferences.register(package)
    operators.register()
    try_frame.register()
    denoise_files.register()
    panels.register()
    for handlers in _render_jobs():
        handlers.append(_forget_frames)
    state = PROCESS.of(_State)
    state.is_registered = True
    if getattr(bpy.app, "module", False) and not state.ends_by_itself:
        # as a module bpy crashes at the interpreter's end where an engine is left
        atexit.register(_end)
        state.ends_by_itself = True


def _end() -> None:
    if PROCESS.of(_State).is_registered:
        unregister()


def unregister() -> None:
    """Take back everything that `register` did."""
    for handlers in _render_jobs():
        handlers.remove(_forget_frames)
    panels.unregister()
    denoise_files.unregister()
    try_frame.unregister()
    operators.unregister()
    preferences.unregister()
    live_picture.unregister()
    thread_guard.unregister()
    engine_override.unregister()
    bpy.utils.unregister_class(engine.XRDSRender)
    del bpy.types.Object.xrds_strength
    del bpy.types.Scene.xrds
    bpy.utils.unregister_class(properties.XRDSSettings)
    PROCESS.of(_State).is_registered = False


@bpy.app.handlers.persistent
def _forget_frames(*_: Any) -> None:
    """Samples of an animation last for one render job."""
    RENDER_JOB.end()


def _render_jobs() -> tuple[Any, ...]:
    """The handlers of a render job's beginning and end."""
    handlers = bpy.app.handlers
    return handlers.render_init, handlers.render_complete, handlers.render_cancel


def ensure_registered() -> None:
    """Register once, for scripts that use the bpy module."""
    if not PROCESS.of(_State).is_registered:
        register()
