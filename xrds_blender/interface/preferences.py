"""The add-on's preferences: what belongs to the machine, not to a scene."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from xrds_core.errors import UsageError

from ..rendering import torch_folder
from . import get_torch, preference_values
from .operators import XRDS_OT_self_test
from .panel.paragraph import translated

# Numbers stay with their devices: a preference holds the number.
_AUTOMATIC = ("auto", "Automatic", "The fastest device that PyTorch finds", 0)
_CPU = ("cpu", "CPU", "The processor, for the denoiser too", 1)
_METAL = ("metal", "Metal", "The GPU of an Apple chip", 2)
_CARDS = ("CUDA", "ROCm")
_MOST_CARDS = 16
_offered: list[tuple[str, str, str, int]] = []


def _devices(_: Any, __: Any) -> list[tuple[str, str, str, int]]:
    """The devices that this machine's PyTorch can use, graphics cards by name."""
    # Blender keeps no reference to the texts of a list made on the fly.
    _offered[:] = [_AUTOMATIC, _CPU, *_graphics_devices()]
    return _offered


def _graphics_devices() -> Iterator[tuple[str, str, str, int]]:
    if sys.platform == "darwin":
        yield _METAL
    try:
        build = torch_folder.available().build.partition(" ")[0]
    except UsageError:
        return
    if build not in _CARDS:
        return
    names = {0: "First graphics card"}  # nothing is loaded only to be offered
    torch = sys.modules.get("torch")
    if torch is not None:
        cards = range(min(torch.cuda.device_count(), _MOST_CARDS))
        names = {i: torch.cuda.get_device_name(i) for i in cards}
    for i, name in names.items():
        yield f"cuda:{i}", name, f"A graphics card ({build})", 10 + i


def _command(_: Any) -> str:
    return get_torch.command()


def _apply_torch(preferences: Any, _: Any = None) -> None:
    """Look for torch where the preferences say; what is wrong is shown below."""
    get_torch.remember(preferences.torch)
    try:
        torch_folder.use(preference_values.folder(preferences.torch))
    except UsageError:
        torch_folder.use(None)


_NAMES = (
    "device",
    "threads",
    "memory_limit",
    "finish_stopped",
    "weights",
    "torch",
)


class XRDS_Preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = preference_values.package

    device: bpy.props.EnumProperty(
        name="Network Device",
        items=_devices,
        description="Where the network of super-resolution runs; Cycles' own device "
        "is in the render properties",
    )
    threads: bpy.props.IntProperty(
        name="Threads (0: Automatic)",
        description="CPU threads of network and denoiser; 0 uses all cores",
        default=0,
        min=0,
        max=1024,
    )
    memory_limit: bpy.props.IntProperty(
        name="Memory Limit (MB)",
        description="Memory that the network may use beside the picture; 0 sets no "
        "limit. With less of it the network works in smaller tiles and takes longer",
        default=0,
        min=0,
    )
    finish_stopped: bpy.props.BoolProperty(
        name="Stop Keeps the Picture",
        description="What you stop with Esc keeps the samples taken so far, quickly "
        "denoised. The frame of an animation is shown, not saved",
        default=True,
    )
    weights: bpy.props.StringProperty(
        name="Weights Folder",
        description="Folder of weights files to use instead of the shipped ones",
        subtype="DIR_PATH",
        default="",
    )
    torch: bpy.props.StringProperty(
        name="PyTorch Folder",
        description="Folder with a PyTorch of your own, for a graphics card or a "
        "pipeline; leave empty for the one that came with XRDS",
        subtype="DIR_PATH",
        default="",
        update=_apply_torch,
    )
    torch_command: bpy.props.StringProperty(
        name="Command",
        description="Downloads PyTorch into a folder of XRDS: run it in a terminal",
        get=_command,
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        for name in _NAMES:
            layout.prop(self, name)
        for icon, line in torch_status(preference_values.folder(self.torch)):
            layout.label(text=line, icon=icon)
        if not torch_folder.is_there():
            self._draw_how_to_get_torch(layout.box())
        layout.operator(XRDS_OT_self_test.bl_idname, icon="CHECKMARK")
        for line in XRDS_OT_self_test.lines:
            layout.label(text=line)

    def _draw_how_to_get_torch(self, layout: Any) -> None:
        layout.use_property_split = False
        layout.label(text=get_torch.NEEDED)
        layout.prop(self, "torch_command", text="")
        layout.operator(get_torch.XRDS_OT_get_torch.bl_idname, icon="COPYDOWN")
        if get_torch.is_looking():
            layout.label(text=get_torch.WAITING, icon="SORTTIME")


def torch_status(folder: Path | None = None) -> list[tuple[str, str]]:
    """Icon and line: which PyTorch is used and on what, or what is wrong."""
    lines = []
    if folder is not None:
        try:
            torch_folder.inspect(folder)
        except UsageError as error:
            lines.append(("ERROR", str(error)))
    try:
        torch = torch_folder.available()
    except UsageError as error:
        return [*lines, ("INFO", str(error))]
    used = {"version": torch.version, "build": torch.build, "folder": torch.folder}
    lines.append(
        ("INFO", translated("PyTorch {version} ({build}) from {folder}", **used))
    )
    loaded = torch_folder.loaded()
    if folder is not None and loaded is not None and loaded != folder:
        lines.append(("ERROR", "Another PyTorch is in use; restart Blender to switch"))
    return lines


_CLASSES = (XRDS_OT_self_test, get_torch.XRDS_OT_get_torch, XRDS_Preferences)


def register(package: str) -> None:
    """Register the preferences under the add-on's module name."""
    XRDS_Preferences.bl_idname = preference_values.package = package
    for item in _CLASSES:
        bpy.utils.register_class(item)
    entry = bpy.context.preferences.addons.get(package)
    if entry and entry.preferences:
        stored = entry.preferences
        if not (stored.torch or torch_folder.is_there()):
            stored.torch = get_torch.remembered()
        if stored.torch:
            _apply_torch(stored)


def unregister() -> None:
    """Take them back."""
    torch_folder.use(None)
    for item in reversed(_CLASSES):
        bpy.utils.unregister_class(item)
