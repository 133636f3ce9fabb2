"""What belongs to the machine rather than to a scene: device, memory, weights."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import bpy

MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Machine:
    """The preferences as plain values; the defaults hold where there is no add-on."""

    device: str = "auto"
    memory_limit: int | None = None
    """Bytes that the network may add; None leaves it to the device."""
    weights: Path | None = None
    """Folder of weights files; None means the shipped ones."""


class XRDS_Preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = __package__ or "xrds_blender"

    device: bpy.props.StringProperty(
        name="Device",
        description="Where the network runs: auto, cpu, cuda, cuda:1, mps",
        default="auto",
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

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "device")
        layout.prop(self, "memory_limit")
        layout.prop(self, "weights")
        for line in torch_status():
            layout.label(text=line, icon="INFO")


def machine() -> Machine:
    """The preferences of the enabled add-on, or the defaults."""
    entry = bpy.context.preferences.addons.get(XRDS_Preferences.bl_idname)
    told: Any = entry and entry.preferences
    if told is None:
        return Machine()
    return Machine(
        device=told.device.strip() or "auto",
        memory_limit=told.memory_limit * MEBIBYTE or None,
        weights=Path(bpy.path.abspath(told.weights)) if told.weights else None,
    )


def torch_status() -> list[str]:
    """Which PyTorch is used, or how this Blender's Python gets one."""
    try:
        return [f"PyTorch {metadata.version('torch')}"]
    except metadata.PackageNotFoundError:
        command = f'"{sys.executable}" -m pip install torch safetensors'
        return ["PyTorch is not there; XRDS can only render plain.", command]


def register(package: str) -> None:
    """Register the preferences under the add-on's module name."""
    XRDS_Preferences.bl_idname = package
    bpy.utils.register_class(XRDS_Preferences)


def unregister() -> None:
    """Take them back."""
    bpy.utils.unregister_class(XRDS_Preferences)
