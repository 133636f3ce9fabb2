"""The XRDS panel in the render properties."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from xrds_core.superres.weights_header import PRESETS

from ...internals.engine_override import ENGINE
from ...internals.lifetimes import FILE
from ...planning.estimates import Capabilities, automatic
from ...planning.request import Request
from ...planning.settings import Mode
from ...rendering import history
from ...rendering.loading import capabilities
from ...rendering.modes import estimates
from ...scene.contents import has_light
from ...scene.strength import SEEN
from .. import live_picture, operators, presets, translations, try_frame
from ..properties import DEADLINE, request_of
from ..translations import CONTEXT
from . import animation, cycles_panels, mode_table, paragraph, scene_cache, summary
from .messages import remarks


class _RenderPanel:
    """Where all of them are, and for which engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_translation_context = CONTEXT
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class XRDS_PT_settings(_RenderPanel, bpy.types.Panel):
    """The mode, and what it asks for."""

    bl_label = "XRDS"
    # Below the choice of the engine: Blender puts panels of add-ons last otherwise.
    bl_parent_id = "RENDER_PT_context"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        presets.XRDS_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        request = request_of(scene.xrds)
        here = capabilities(request.machine.weights)
        if scene_cache.is_animation(scene):
            animation.draw(layout, context, request)
            layout.separator()
        shot = scene_cache.is_shot(scene, request)
        estimated = estimates(scene, request.settings, here, shot)
        mode_table.draw(layout, scene, here, automatic(here.denoiser), estimated)
        if shot:
            try_frame.draw_try(layout, scene, request)
        layout.use_property_split = True
        layout.use_property_decorate = False
        _draw_choices(layout, scene, request, here)
        for icon, text in remarks(scene, request, here):
            paragraph.draw(layout, context, paragraph.translated(text), icon)
        for text in animation.notes(scene, request):
            paragraph.draw(layout, context, text, "INFO")


def _draw_choices(
    layout: Any, scene: Any, request: Request, here: Capabilities
) -> None:
    """What can be chosen in the mode that is taken."""
    settings = scene.xrds
    if settings.mode == Mode.AUTOMATIC and here.any_denoiser:
        _switched(layout, settings, "use_time_budget", "time_budget")
    column = layout.column()
    column.active = not settings.is_timed
    name = "Max Samples" if scene.cycles.use_adaptive_sampling else "Samples"
    if request.settings.is_enlarged:
        name = "Low-Resolution Samples"
    column.prop(scene.cycles, "samples", text=name, text_ctxt=CONTEXT)
    if settings.mode == Mode.FULL_SIZE:
        column.prop(settings, "denoise")
    if request.settings.is_enlarged:
        scale = request.settings.scale
        offered = [preset for preset in PRESETS if (preset, scale) in here.networks]
        _offer(column, settings, "preset", offered)
    if not request.settings.is_cycles_only:
        layout.prop(settings, "temporal_radius")
        if request.settings.temporal_radius:
            layout.prop(settings, "strength")
    if request.settings.mode is Mode.FULL_SIZE and request.settings.temporal_radius:
        layout.prop(settings, "animation")
        if settings.animation == DEADLINE:
            layout.prop(settings, "deadline")
    layers = (layer for layer in scene.view_layers if layer.use)
    if request.settings.mode is Mode.FULL_SIZE and any(map(has_light, layers)):
        layout.prop(settings, "passes")


class _OtherEnginePanel:
    """Where XRDS is found under another engine."""

    bl_label = "XRDS"
    bl_parent_id = "RENDER_PT_context"
    bl_space_type = _RenderPanel.bl_space_type
    bl_region_type = _RenderPanel.bl_region_type
    bl_context = _RenderPanel.bl_context
    bl_translation_context = CONTEXT
    # under a name of our own: Cycles' panels of Blender's show under XRDS as well
    engines: set[str] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.engines


class XRDS_PT_under_cycles(_OtherEnginePanel, bpy.types.Panel):
    """What XRDS would make of the scene, under Cycles."""

    engines = {cycles_panels.CYCLES}

    def draw(self, context: bpy.types.Context) -> None:
        scene = context.scene
        request = request_of(scene.xrds)
        if scene_cache.is_animation(scene):
            animation.draw(self.layout, context, request)
        if scene_cache.is_shot(scene, request):
            try_frame.draw_try(self.layout, scene, request)
        operators.draw(self.layout.column(align=True))


class XRDS_PT_under_others(_OtherEnginePanel, bpy.types.Panel):
    """What XRDS renders with where the file's engine is not Cycles."""

    engines = {"BLENDER_EEVEE", "BLENDER_EEVEE_NEXT", "BLENDER_WORKBENCH"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, cycles = self.layout, context.scene.cycles
        paragraph.draw(layout, context, paragraph.translated(RENDERS_BY_CYCLES))
        row = layout.row()
        row.use_property_split, row.use_property_decorate = True, False
        row.prop(cycles, "samples", text="Cycles Samples", text_ctxt=CONTEXT)
        operators.draw(layout.column(align=True))


RENDERS_BY_CYCLES = (
    "XRDS renders this file by Cycles, with Cycles' settings: the picture differs from "
    "that of this engine"
)


class XRDS_PT_guides(_RenderPanel, bpy.types.Panel):
    """What is rendered at full size."""

    bl_label = "Guides"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and Mode(context.scene.xrds.mode).is_enlarged

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "guide_samples")


class XRDS_PT_advanced(_RenderPanel, bpy.types.Panel):
    """What few scenes need."""

    bl_label = "Advanced"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.xrds
        may_enlarge = Mode(settings.mode).is_enlarged
        return super().poll(context) and may_enlarge

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        _switched(layout, settings, "use_exposure", "exposure")


class XRDS_PT_object(_RenderPanel, bpy.types.Panel):
    """What an object is to have otherwise than the scene, among its properties."""

    bl_label = "XRDS"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        item = getattr(context, "object", None)
        return super().poll(context) and item is not None and item.type in SEEN

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.object, "xrds_strength")


class XRDS_PT_forecast(_RenderPanel, bpy.types.Panel):
    """What the next render will do."""

    bl_label = "What Will Be Rendered"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        scene, request = context.scene, request_of(context.scene.xrds)
        for name, value in summary.next_render(scene, request):
            _row(self.layout, name, value)


class XRDS_PT_last_render(_RenderPanel, bpy.types.Panel):
    """Where the time of the last render went."""

    bl_label = "Last Render"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and history.last(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        last = history.last(context.scene)
        assert last is not None
        for name, value in summary.last_render(last):
            _row(self.layout, name, value)


def _offer(layout: Any, settings: Any, name: str, offered: list[str]) -> None:
    """A choice of what is there; none to make where there is only one."""
    if len(offered) < 2:
        return
    heading = settings.bl_rna.properties[name].name
    row = layout.row(heading=heading, heading_ctxt=CONTEXT, align=True)
    for value in offered:
        row.prop_enum(settings, name, value)


def _switched(layout: Any, settings: Any, switch: str, name: str) -> None:
    """A switch and the value it brings into force in one row, as Cycles has them."""
    heading = settings.bl_rna.properties[switch].name
    column = layout.column(heading=heading, heading_ctxt=CONTEXT)
    row = column.row(align=True)
    row.prop(settings, switch, text="")
    value = row.row()
    value.active = getattr(settings, switch)
    value.prop(settings, name, text="")


def _row(layout: Any, name: str, value: str) -> None:
    """A name at the left, a value at the right, as Blender's own statistics."""
    split = layout.split(factor=0.4)
    side = split.row()
    side.alignment = "RIGHT"
    side.label(text=name, text_ctxt=CONTEXT)
    split.label(text=value, translate=False)


CLASSES = (
    XRDS_PT_settings,
    XRDS_PT_guides,
    XRDS_PT_advanced,
    XRDS_PT_forecast,
    XRDS_PT_last_render,
    XRDS_PT_object,
    XRDS_PT_under_cycles,
    XRDS_PT_under_others,
)


@persistent
def _forget_facts(*_: object) -> None:
    scene_cache.forget()


@persistent
def _forget_file(*_: object) -> None:
    FILE.end()


@persistent
def _draw_again(*_: object) -> None:
    """Seconds are known after a render; Blender draws the panel only on request."""
    if not bpy.app.background:
        bpy.app.timers.register(scene_cache.redraw, first_interval=0.1)


def _handlers() -> tuple[tuple[Any, Any], ...]:
    handlers = bpy.app.handlers
    return (
        (handlers.depsgraph_update_post, _forget_facts),
        (handlers.load_post, _forget_file),
        (handlers.render_complete, _draw_again),
        (handlers.render_cancel, _draw_again),
    )


def register() -> None:
    """Register the panels and show Cycles' own under XRDS."""
    translations.register()
    presets.register()
    bpy.utils.register_class(animation.XRDS_OT_take_offer)
    for panel in CLASSES:
        bpy.utils.register_class(panel)
    cycles_panels.register()
    bpy.types.STATUSBAR_HT_header.prepend(live_picture.draw_status)
    for event, handler in _handlers():
        event.append(handler)


def unregister() -> None:
    """Take all of it back."""
    for event, handler in _handlers():
        event.remove(handler)
    bpy.types.STATUSBAR_HT_header.remove(live_picture.draw_status)
    cycles_panels.unregister()
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
    bpy.utils.unregister_class(animation.XRDS_OT_take_offer)
    presets.unregister()
    translations.unregister()
