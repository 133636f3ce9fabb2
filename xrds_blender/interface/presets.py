"""Presets of the XRDS panel, in Blender's own preset menu."""

from __future__ import annotations

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

FOLDER = "xrds/render"
SHIPPED = Path(__file__).parent / "shipped"
"""Holds `presets`/FOLDER; Blender wants the folder above."""


class XRDS_PT_presets(PresetPanel, bpy.types.Panel):
    """Choose, add or remove a preset."""

    bl_label = "XRDS Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "xrds.preset_add"


class XRDS_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of the XRDS settings"""

    bl_idname = "xrds.preset_add"
    bl_label = "Add XRDS Preset"
    preset_menu = "XRDS_PT_presets"
    preset_subdir = FOLDER
    preset_defines = ["scene = bpy.context.scene"]
    preset_values = [
        "scene.xrds.mode",
        "scene.xrds.use_time_budget",
        "scene.xrds.time_budget",
        "scene.xrds.denoise",
        "scene.xrds.temporal_radius",
        "scene.xrds.animation",
        "scene.xrds.deadline",
        "scene.xrds.passes",
        "scene.xrds.preset",
        "scene.xrds.guide_samples",
        "scene.xrds.use_exposure",
        "scene.xrds.exposure",
        "scene.cycles.samples",
    ]


CLASSES = (XRDS_PT_presets, XRDS_OT_preset_add)


def register() -> None:
    """Register the menu and the presets that come with XRDS."""
    for item in CLASSES:
        bpy.utils.register_class(item)
    bpy.utils.register_preset_path(str(SHIPPED))


def unregister() -> None:
    """Take them back."""
    bpy.utils.unregister_preset_path(str(SHIPPED))
    for item in reversed(CLASSES):
        bpy.utils.unregister_class(item)
