"""How to get a PyTorch for super-resolution: a command, a folder, a look at the result.

An add-on may not download by itself, so the user runs the command, in a terminal.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import bpy

from xrds_core.errors import UsageError

from ..internals.lifetimes import PROCESS
from ..rendering import torch_folder
from . import preference_values

LOOK_AGAIN = 2.0  # seconds between two looks for the result
NEEDED = "Super-resolution needs PyTorch: 0.2 GB to download, 0.9 GB on the disk"
WAITING = "Paste it into a terminal; XRDS takes PyTorch as soon as it is there"


@dataclass
class _Search:
    """Whether the folder is looked at again and again."""

    goes_on: bool = False


def folder() -> Path:
    """Where PyTorch goes: a folder of the user's that updates of XRDS leave alone."""
    name = f"pytorch-py{sys.version_info.major}{sys.version_info.minor}"
    return _home() / name


def command() -> str:
    """The command that fills that folder, for a terminal."""
    return torch_folder.install(folder())


def remember(chosen: str) -> None:
    """Keep the folder of the preferences, which Blender forgets with the add-on off."""
    note = _home() / "pytorch_folder.txt"
    if chosen:
        note.parent.mkdir(parents=True, exist_ok=True)
        note.write_text(chosen, "utf-8")
    else:
        note.unlink(missing_ok=True)


def remembered() -> str:
    """The folder of the preferences before the add-on was off, or that of the command.

    Empty where neither holds a PyTorch for this Blender.
    """
    note = _home() / "pytorch_folder.txt"
    chosen = note.read_text("utf-8") if note.is_file() else ""
    for candidate in (chosen, str(folder())):
        path = preference_values.folder(candidate)
        if path is not None and _fits(path):
            return candidate
    return ""


def is_looking() -> bool:
    """Whether the command has been copied and its result is waited for."""
    return PROCESS.of(_Search).goes_on


def _home() -> Path:
    try:
        return Path(bpy.utils.extension_path_user(preference_values.package))
    except ValueError:  # not installed as an extension
        return Path(bpy.utils.user_resource("DATAFILES", path="xrds"))


def _fits(path: Path) -> bool:
    if not all((path / name).is_dir() for name in torch_folder.NEEDED):
        return False
    try:
        torch_folder.inspect(path)
    except UsageError:
        return False
    return True


def _look() -> float | None:
    search = PROCESS.of(_Search)
    entry = bpy.context.preferences.addons.get(preference_values.package)
    if entry is None or not search.goes_on:
        search.goes_on = False
        return None
    if not _fits(folder()):
        return LOOK_AGAIN
    search.goes_on = False
    entry.preferences.torch = str(folder())
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
    return None


class XRDS_OT_get_torch(bpy.types.Operator):
    """Copy the command and begin to look for what it leaves."""

    bl_idname = "xrds.get_torch"
    bl_label = "Copy the Command for PyTorch"
    bl_description = (
        "Copy the command that downloads PyTorch, for you to paste into a terminal; "
        "XRDS uses PyTorch as soon as it is there"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        folder().parent.mkdir(parents=True, exist_ok=True)
        context.window_manager.clipboard = command()
        search = PROCESS.of(_Search)
        if not search.goes_on:
            search.goes_on = True
            bpy.app.timers.register(_look, first_interval=LOOK_AGAIN)
        self.report({"INFO"}, "Copied: paste it into a terminal and press Enter")
        return {"FINISHED"}
