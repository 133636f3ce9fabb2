"""`blender --command xrds`: the command line inside a Blender program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from ..internals.lifetimes import PROCESS


@dataclass
class _Registered:
    """Blender's handle of the command, while it is known."""

    handle: Any = None


def register() -> None:
    """Make the command known to Blender; the module bpy would never ask for it."""
    if getattr(bpy.app, "module", False):
        return
    PROCESS.of(_Registered).handle = bpy.utils.register_cli_command("xrds", _run)


def unregister() -> None:
    """Take it back, where it was registered."""
    state = PROCESS.of(_Registered)
    if state.handle is not None:
        bpy.utils.unregister_cli_command(state.handle)
        state.handle = None


def _run(argv: list[str]) -> int:
    from . import console
    from .main import main

    console.prepare()
    return console.finished(main(argv))
