"""The add-on as Blender loads it; all of its work is in the wheel beside it."""

from __future__ import annotations

import xrds_blender


def register() -> None:
    """Make Blender know the engine under this add-on's own name."""
    xrds_blender.register(__package__)


def unregister() -> None:
    """Take everything back."""
    xrds_blender.unregister()
