"""The add-on as Blender loads it; all of its work is in the wheel beside it."""

from __future__ import annotations

import sys


def register() -> None:
    """Make Blender know the engine under this add-on's own name."""
    import xrds_blender

    xrds_blender.register(__package__)


def unregister() -> None:
    """Take everything back, the wheel's modules too: an update brings its own."""
    import xrds_blender

    xrds_blender.unregister()
    for name in list(sys.modules):
        if name.partition(".")[0] in {"xrds_blender", "xrds_core"}:
            del sys.modules[name]
