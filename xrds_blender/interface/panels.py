"""The XRDS panel in the render properties."""

from __future__ import annotations

import textwrap
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from ..cycles import session
from ..frame import denoisers, progress, torch_folder
from ..frame.job import ENGINE
from ..planning import forecast
from . import cycles_panels, presets, status_bar, support, translations
from .translations import CONTEXT

if TYPE_CHECKING:
    from .facts_cache import FactsCache

CHARACTER = 6.5  # pixels that a letter takes on the average, at an interface scale of 1
NO_DENOISER = "The denoiser is missing: install XRDS from its zip, or mitsuba-oidn"
STAGE_NAMES = {
    "sync": "Scene",
    "beauty": "Samples",
    "accumulate": "Accumulation",
    "denoise": "Denoising",
    "guides": "Guides",
    "network": "Network",
    "write": "Writing",
    "total": "Total",
}


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
    """Scale, quality and samples of the XRDS engine."""

    bl_label = "Super-Resolution"
    # Below the choice of the engine: Blender puts panels of add-ons last otherwise.
    bl_parent_id = "RENDER_PT_context"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        presets.XRDS_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        _switched(layout, settings, "use_time_budget", "time_budget")
        column = layout.column()
        column.active = not (settings.plain or settings.use_time_budget)
        column.prop(settings, "scale")
        if settings.scale == "1":
            column.prop(settings, "denoise")
            column.prop(settings, "temporal_radius")
        else:
            column.prop(settings, "preset")
        layout.prop(scene.cycles, "samples")
        layout.prop(settings, "plain")
        width = context.region.width / context.preferences.system.ui_scale
        for icon, text in remarks(scene):
            _paragraph(layout, icon, text, width)


class XRDS_PT_forecast(_RenderPanel, bpy.types.Panel):
    """What the next render will do."""

    bl_label = "What Will Be Rendered"
    bl_parent_id = "XRDS_PT_settings"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and not context.scene.xrds.plain

    def draw(self, context: bpy.types.Context) -> None:
        for name, value in summary(context.scene):
            _row(self.layout, name, value)


class XRDS_PT_guides(_RenderPanel, bpy.types.Panel):
    """What is rendered at full size."""

    bl_label = "Guides"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = not settings.plain and settings.scale != "1"
        layout.prop(settings, "guides")
        layout.prop(settings, "guide_samples")


class XRDS_PT_advanced(_RenderPanel, bpy.types.Panel):
    """What few scenes need."""

    bl_label = "Advanced"
    bl_parent_id = "XRDS_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.xrds
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = not settings.plain
        _switched(layout, settings, "use_exposure", "exposure")


class XRDS_PT_last_render(_RenderPanel, bpy.types.Panel):
    """Where the time of the last render went."""

    bl_label = "Last Render"
    bl_parent_id = "XRDS_PT_settings"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and bool(progress.last_seconds())

    def draw(self, context: bpy.types.Context) -> None:
        seconds = progress.last_seconds()
        for stage, name in STAGE_NAMES.items():
            if seconds[stage] > 0.0:
                _row(self.layout, name, f"{seconds[stage]:.1f} s")


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


def _paragraph(layout: Any, icon: str, text: str, width: float) -> None:
    """Lines as long as the panel is wide: a label alone would be cut off."""
    translated = bpy.app.translations.pgettext_iface(text)
    letters = max(int((width - 60) / CHARACTER), 20)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in textwrap.wrap(translated, letters):
        column.label(text=line, icon=icon, translate=False)
        icon = "BLANK1"


def remarks(scene: bpy.types.Scene) -> list[tuple[str, str]]:
    """Icon and sentence of all that is missing or otherwise than under Cycles."""
    if scene.xrds.plain:
        return [("INFO", "Plain: one full-resolution Cycles render, no network")]
    if scene.xrds.scale == "1":
        return [] if denoisers.is_there() else [("ERROR", NO_DENOISER)]
    lines = []
    if not torch_folder.is_there():
        lines.append(("ERROR", "PyTorch is missing: see the add-on's preferences"))
    if not (session.has_denoiser() or denoisers.is_there()):
        sentence = (
            "There is no denoiser: the network gets the noisy picture. "
            "Use more samples, or install mitsuba-oidn"
        )
        lines.append(("INFO", sentence))
    return lines + [("INFO", sentence) for sentence in support.notes(scene)]


@lru_cache(maxsize=1)
def _facts_cache() -> FactsCache:
    """Made when a panel is first drawn: Blender starts faster without its modules."""
    from .facts_cache import FactsCache

    return FactsCache()


def summary(scene: bpy.types.Scene) -> list[tuple[str, str]]:
    """Name and value of what the render will do, take and leave out."""
    from .machine import machine
    from .properties import job_of

    job = job_of(scene.xrds)
    if job.is_picked:
        return [("Settings", "chosen when rendering")]
    if not job.is_enlarged:
        return [(d.decision.capitalize(), d.value) for d in job.plan().decisions]
    facts = _facts_cache().facts(scene, bpy.context.view_layer, job)
    chosen = job.plan(facts)
    width, height = forecast.low_size(facts.width, facts.height, job.scale)
    light, guide = forecast.rays(scene.cycles.samples, chosen.guide_samples, job.scale)
    limit = machine().memory_limit
    bytes_taken = forecast.memory(
        facts.width, facts.height, job.preset, job.scale, limit
    )
    rows = [
        ("Small Render", f"{width} × {height}, {scene.cycles.samples} spp"),
        ("Guides", f"{facts.width} × {facts.height}, {chosen.guide_samples} spp"),
        ("Rays per Pixel", f"{light:.3g} + {guide:.3g}"),
        ("Memory", f"≤ {_amount(bytes_taken)}"),
    ]
    decisions = [d for d in chosen.decisions if d.decision != "low frame"]
    return rows + [(d.decision.capitalize(), d.value) for d in decisions]


def _amount(size: float) -> str:
    """Bytes as a person reads them."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(size / 1e6, 1):.0f} MB"


CLASSES = (
    XRDS_PT_settings,
    XRDS_PT_forecast,
    XRDS_PT_guides,
    XRDS_PT_advanced,
    XRDS_PT_last_render,
)


@persistent
def _forget(*_: object) -> None:
    if _facts_cache.cache_info().currsize:
        _facts_cache().forget()


def _changes() -> tuple[Any, ...]:
    handlers = bpy.app.handlers
    return handlers.depsgraph_update_post, handlers.load_post


def register() -> None:
    """Register the panels and show Cycles' own under XRDS."""
    translations.register()
    presets.register()
    for panel in CLASSES:
        bpy.utils.register_class(panel)
    cycles_panels.register()
    bpy.types.STATUSBAR_HT_header.append(status_bar.draw)
    for changes in _changes():
        changes.append(_forget)


def unregister() -> None:
    """Take all of it back."""
    for changes in _changes():
        changes.remove(_forget)
    bpy.types.STATUSBAR_HT_header.remove(status_bar.draw)
    cycles_panels.unregister()
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
    presets.unregister()
    translations.unregister()
