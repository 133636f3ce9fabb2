"""The XRDS panel in the render properties, and Cycles' own panels beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .explain import Glance
from .job import RenderJob
from .operators import ENGINE, XRDS_OT_render


class XRDS_PT_settings(bpy.types.Panel):
    """Scale, quality and guides of the XRDS engine."""

    bl_label = "Super-Resolution"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_order = -1
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.operator(XRDS_OT_render.bl_idname, icon="RENDER_STILL")
        layout.prop(settings, "plain")
        layout.prop(settings, "use_time_budget")
        row = layout.row()
        row.active = settings.use_time_budget
        row.prop(settings, "time_budget")
        column = layout.column()
        column.active = not (settings.plain or settings.use_time_budget)
        column.prop(settings, "scale")
        column.prop(settings, "preset")
        column.prop(settings, "guides")
        column.prop(settings, "guide_samples")
        column.prop(settings, "device")
        for line in summary(context.scene):
            layout.label(text=line, icon="INFO")


class XRDS_PT_advanced(bpy.types.Panel):
    """What few scenes need."""

    bl_label = "Advanced"
    bl_parent_id = "XRDS_PT_settings"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.prop(settings, "use_exposure")
        row = layout.row()
        row.active = settings.use_exposure
        row.prop(settings, "exposure")


_glance = Glance()


def summary(scene: bpy.types.Scene) -> list[str]:
    """What the render will do and leave out, one line each."""
    job = RenderJob.of(scene.xrds)
    if job.is_picked:
        return ["Scale, samples, guides, network and denoiser: chosen when rendering"]
    if job.is_plain:
        return ["Plain: one full-resolution Cycles render, no network"]
    facts = _glance.facts(scene, bpy.context.view_layer, job)
    return [f"{d.decision.capitalize()}: {d.value}" for d in job.plan(facts).decisions]


def _cycles_classes(base: Any = None) -> Iterator[Any]:
    """All registered panels and menus that name Cycles."""
    for root in (base,) if base else (bpy.types.Panel, bpy.types.Menu):
        for found in root.__subclasses__():
            if "CYCLES" in getattr(found, "COMPAT_ENGINES", ()):
                yield found
            yield from _cycles_classes(found)


CLASSES = (XRDS_PT_settings, XRDS_PT_advanced)


@persistent
def _forget(*_: object) -> None:
    _glance.forget()


def _changes() -> tuple[Any, ...]:
    handlers = bpy.app.handlers
    return handlers.depsgraph_update_post, handlers.load_post


def register() -> None:
    """Register the panels and show Cycles' own under XRDS, too."""
    for panel in CLASSES:
        bpy.utils.register_class(panel)
    for found in _cycles_classes():
        found.COMPAT_ENGINES.add(ENGINE)
    for changes in _changes():
        changes.append(_forget)


def unregister() -> None:
    """Take all of it back."""
    for changes in _changes():
        changes.remove(_forget)
    for found in _cycles_classes():
        found.COMPAT_ENGINES.discard(ENGINE)
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
