"""Everything that Blender has to know, registered in order and taken back."""

from __future__ import annotations

import bpy

from ..cycles import session
from . import engine, operators, panels, preferences, properties, write_lock

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
    write_lock.register()
    preferences.register(package)
    operators.register()
    panels.register()
    _registered = True


def unregister() -> None:
    """Take back everything that `register` did."""
    global _registered
    panels.unregister()
    operators.unregister()
    preferences.unregister()
    write_lock.unregister()
    bpy.utils.unregister_class(engine.XRDSRender)
    del bpy.types.Scene.xrds
    bpy.utils.unregister_class(properties.XRDSSettings)
    _registered = False


def ensure_registered() -> None:
    """Register once, for scripts that use the bpy module."""
    if not _registered:
        register()
