"""Everything that Blender has to know, registered in order and taken back."""

from __future__ import annotations

import sys
from typing import Any

import bpy

from ..cycles import session
from ..frame import engine_loan
from . import (
    engine,
    live_picture,
    operators,
    panels,
    preferences,
    properties,
    write_lock,
)

_ADD_ON = __name__.partition(".")[0]
_registered = False


def register(package: str = "xrds_blender") -> None:
    """Register engine, settings, preferences, operators and panels.

    `package` is the add-on's module name, under which Blender keeps its preferences.
    """
    global _registered
    session.functions()
    bpy.utils.register_class(properties.XRDSSettings)
    bpy.types.Scene.xrds = bpy.props.PointerProperty(type=properties.XRDSSettings)
    bpy.utils.register_class(engine.XRDSRender)
    engine_loan.register()  # before those who ask for a scene's engine
    write_lock.register()
    live_picture.register()
    preferences.register(package)
    operators.register()
    panels.register()
    for handlers in _render_jobs():
        handlers.append(_forget_frames)
    _registered = True


def unregister() -> None:
    """Take back everything that `register` did."""
    global _registered
    for handlers in _render_jobs():
        handlers.remove(_forget_frames)
    panels.unregister()
    operators.unregister()
    preferences.unregister()
    live_picture.unregister()
    write_lock.unregister()
    engine_loan.unregister()
    bpy.utils.unregister_class(engine.XRDSRender)
    del bpy.types.Scene.xrds
    bpy.utils.unregister_class(properties.XRDSSettings)
    _registered = False


@bpy.app.handlers.persistent
def _forget_frames(*_: Any) -> None:
    """Samples of an animation last for one render job."""
    render = sys.modules.get(f"{_ADD_ON}.shot.render")
    if render is not None:
        render.forget()


def _render_jobs() -> tuple[Any, ...]:
    """The handlers of a render job's beginning and end."""
    handlers = bpy.app.handlers
    return handlers.render_init, handlers.render_complete, handlers.render_cancel


def ensure_registered() -> None:
    """Register once, for scripts that use the bpy module."""
    if not _registered:
        register()
