"""The add-on as Blender loads it; all of its work is in the wheel beside it."""

from __future__ import annotations

import sys


def register() -> None:
    """Make Blender know the engine under this add-on's own name.

    Raises RuntimeError where the zip's wheels are not for this Blender.
    """
    try:
        import xrds_blender
        import xrds_core.errors  # noqa: F401  # in the same wheel
    except ModuleNotFoundError as error:
        python = f"cp{sys.version_info.major}{sys.version_info.minor}"
        raise RuntimeError(
            f"XRDS finds no {error.name}: remove XRDS, restart Blender, and install "
            f"the zip whose name ends in this system and {python}"
        ) from None
    xrds_blender.register(__package__)


def unregister() -> None:
    """Take everything back, the wheel's modules too: an update brings its own."""
    import xrds_blender

    xrds_blender.unregister()
    for name in list(sys.modules):
        if name.partition(".")[0] in {"xrds_blender", "xrds_core"}:
            del sys.modules[name]
