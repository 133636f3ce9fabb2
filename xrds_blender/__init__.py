"""The Blender add-on: the XRDS render engine and its commands.

Importing it needs neither Blender nor torch; `register()` needs Blender.
"""

from __future__ import annotations

from typing import Any

_registered = False


def register(package: str = __name__) -> None:
    """Make Blender know the engine, its settings and its panels.

    `package` is the add-on's module name, under which Blender keeps its preferences.
    """
    import bpy

    from . import (
        cycles_session,
        engine,
        operators,
        panels,
        preferences,
        properties,
        write_lock,
    )

    global _registered
    cycles_session.functions()
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
    import bpy

    from . import engine, operators, panels, preferences, properties, write_lock

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


def __getattr__(name: str) -> Any:
    """Load `render`, `run_job` and their types when first asked for."""
    if name in {"render", "run_job", "RenderJob", "Picture"}:
        from importlib import import_module

        module = import_module(".render", __name__)
        return module if name == "render" else getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
