"""The add-on's preferences: what belongs to the machine, not to a scene."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bpy

from xrds_core.errors import UsageError

from ..frame import torch_folder
from . import machine
from .self_test import XRDS_OT_self_test

# Numbers stay with their devices: a preference holds the number.
_DEVICES = [
    (
        "auto",
        "Automatic",
        "A graphics card if PyTorch finds one",
        0,
    ),
    ("cpu", "CPU", "Always the CPU", 1),
    ("mps", "Metal", "The GPU of an Apple chip", 2),
]
_MOST_CARDS = 16
_cards: list[tuple[str, str, str, int]] = []


def _devices(_: Any, __: Any) -> list[tuple[str, str, str, int]]:
    """The devices to choose from; graphics cards by name once torch is loaded."""
    torch = sys.modules.get("torch")
    names = {0: "First graphics card"}
    if torch is not None and torch.cuda.is_available():
        cards = range(min(torch.cuda.device_count(), _MOST_CARDS))
        names = {i: torch.cuda.get_device_name(i) for i in cards}
    # Blender keeps no reference to the texts of a list made on the fly.
    _cards[:] = [
        (f"cuda:{i}", name, "A graphics card (CUDA or ROCm)", 10 + i)
        for i, name in names.items()
    ]
    return [*_DEVICES, *_cards]


def _apply_torch(preferences: Any, _: Any = None) -> None:
    """Look for torch where the preferences say; what is wrong is shown below."""
    try:
        torch_folder.use(machine.folder(preferences.torch))
    except UsageError:
        torch_folder.use(None)


class XRDS_Preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = machine.package

    device: bpy.props.EnumProperty(
        name="Device", items=_devices, description="Where the network runs"
    )
    threads: bpy.props.IntProperty(
        name="Threads",
        description="CPU threads of network and denoiser; 0 uses all cores",
        default=0,
        min=0,
        max=1024,
    )
    memory_limit: bpy.props.IntProperty(
        name="Memory Limit",
        description="Megabytes that the network may use on top of the picture; "
        "0 sets no limit. Less memory means smaller tiles",
        default=0,
        min=0,
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

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        for name in ("device", "threads", "memory_limit", "weights", "torch"):
            layout.prop(self, name)
        for icon, line in torch_status(machine.folder(self.torch)):
            layout.label(text=line, icon=icon)
        layout.operator(XRDS_OT_self_test.bl_idname, icon="CHECKMARK")
        for line in XRDS_OT_self_test.lines:
            layout.label(text=line)


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
        return [*lines, ("ERROR", str(error)), ("BLANK1", _install())]
    lines.append(
        ("INFO", f"PyTorch {torch.version} ({torch.build}) from {torch.folder}")
    )
    loaded = torch_folder.loaded()
    if folder is not None and loaded is not None and loaded != folder:
        lines.append(("ERROR", "Another PyTorch is in use; restart Blender to switch"))
    return lines


def _install() -> str:
    return torch_folder.install(Path("FOLDER"))


def register(package: str) -> None:
    """Register the preferences under the add-on's module name."""
    XRDS_Preferences.bl_idname = machine.package = package
    bpy.utils.register_class(XRDS_OT_self_test)
    bpy.utils.register_class(XRDS_Preferences)
    entry = bpy.context.preferences.addons.get(package)
    if entry and entry.preferences and entry.preferences.torch:
        _apply_torch(entry.preferences)


def unregister() -> None:
    """Take them back."""
    torch_folder.use(None)
    bpy.utils.unregister_class(XRDS_Preferences)
    bpy.utils.unregister_class(XRDS_OT_self_test)
