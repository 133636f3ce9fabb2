"""`blender --command xrds`: the command line inside a Blender program."""

from __future__ import annotations

from typing import Any

import bpy

_handle: Any = None


def register() -> None:
    """Make the command known to Blender."""
    global _handle
    _handle = bpy.utils.register_cli_command("xrds", _run)


def unregister() -> None:
    """Take it back, where it was registered."""
    global _handle
    if _handle is not None:
        bpy.utils.unregister_cli_command(_handle)
        _handle = None


def _run(argv: list[str]) -> int:
    from . import console
    from .main import main

    console.prepare()
    return console.finished(main(argv))
