"""What the next render will do, and what the last one did, in rows of two words."""

from __future__ import annotations

from typing import Any

import bpy

from ...cycles.view import frame_size
from ...planning import estimates
from ...planning.plan import Plan
from ...planning.request import Request
from ...planning.settings import Mode, Settings
from ...rendering.history import LastRender, scene_settings
from ..preference_values import preference_values
from ..properties import DENOISE
from . import scene_cache
from .mode_table import NAMES
from .paragraph import translated

Row = tuple[str, str]
MOST_ROWS = 6
_STAGES = {
    "load": "Loading",
    "sync": "Scene",
    "beauty": "Samples",
    "accumulate": "Neighbouring Frames",
    "denoise": "Denoising",
    "again": "Denoising Again",
    "guides": "Guides",
    "network": "Network",
    "write": "Writing",
    "total": "Total",
}
_QUALITIES = {quality: label for quality, label, _ in DENOISE}


def next_render(scene: Any, request: Request) -> list[Row]:
    """Name and value of what the render will do, take and leave out; six at most."""
    size = frame_size(scene.render)
    if request.time_budget is not None:
        return [("Picture", _size(*size)), *_neighbours(scene, request)]
    if request.settings.is_enlarged:
        return _rows_of_enlarged(scene, request)
    rows = [("Picture", _sampled(*size, scene.cycles.samples))]
    if request.settings.is_cycles_only:
        own = scene_settings(scene).denoising
        named = own and f"OIDN {own.quality.title()}, {own.prefilter.title()}"
        shown = named or translated("none")
        return [*rows, ("Denoising", shown)]
    rows.append(("Denoising", translated(_QUALITIES[request.settings.quality])))
    if scene.cycles.use_denoising:
        rows.append(("Cycles' Denoise", translated("not used")))
    return rows + _neighbours(scene, request)


def _neighbours(scene: Any, request: Request) -> list[Row]:
    """How many frames an animation stores, and the memory that they take."""
    radius, size = request.settings.temporal_radius, frame_size(scene.render)
    if not scene_cache.is_shot(scene, request):
        return []
    text = "{radius} before and after, {memory}"
    taken = _format_bytes(estimates.shot_memory(*size, radius, request.settings.scale))
    shown = translated(text, radius=radius, memory=taken)
    return [("Neighbouring Frames", shown)]


def _named(settings: Settings) -> str:
    """Mode and samples."""
    return f"{translated(NAMES[settings.mode])}, {_samples(settings.samples or 0)}"


def _rows_of_enlarged(scene: Any, request: Request) -> list[Row]:
    facts = scene_cache.facts(scene, bpy.context.view_layer, request.settings)
    chosen = request.plan(facts)
    size = facts.width, facts.height
    small = estimates.low_size(*size, request.settings.scale)
    limit = preference_values().memory_limit
    taken = estimates.memory(*size, *request.settings.network, limit)
    guides = _sampled(*size, chosen.guide_samples)
    rows = [
        ("Low Resolution", _sampled(*small, scene.cycles.samples)),
        ("Guides", guides if chosen.render_guides else translated("none")),
        ("Memory", f"≤ {_format_bytes(taken)}"),
        *_neighbours(scene, request),
    ]
    skipped = ", ".join(translated(name) for name in _list_skipped(chosen))
    return [*rows, ("Skipped", skipped)] if skipped else rows


def _list_skipped(chosen: Plan) -> list[str]:
    """What the scene does not need."""
    parts = {
        "light in the guides": chosen.render_guides and not chosen.guides.sample_world,
        "mirrors in the guides": chosen.render_guides and not chosen.guides.bounces,
        "the denoiser": not chosen.denoise,
        "motion blur": any(
            decision.decision == "motion blur" and decision.value == "skipped"
            for decision in chosen.decisions
        ),
    }
    return [name for name, is_skipped in parts.items() if is_skipped]


def last_render(last: LastRender) -> list[Row]:
    """What the last render was, and where its seconds went."""
    rows = [("Mode", _named(last.settings))]
    for stage, name in _STAGES.items():
        spent = last.seconds.get(stage, 0.0)
        if spent >= 0.05 or stage == "total":
            shown, device = f"{spent:.1f} s", last.devices.get(stage, "")
            if device not in ("", "cpu"):
                shown += f", {device}"
            rows.append((_stage(stage, name, last.settings.mode), shown))
    return rows


def _stage(stage: str, name: str, mode: Mode) -> str:
    """Cycles reports its samples and its denoising as one."""
    if stage != "beauty":
        return name
    if mode.is_enlarged:
        return "Low Resolution"
    return "Samples and Denoising" if mode is Mode.CYCLES_ONLY else name


def _sampled(width: int, height: int, samples: int) -> str:
    return f"{_size(width, height)}, {_samples(samples)}"


def _samples(count: int) -> str:
    return translated("{count} samples" if count > 1 else "1 sample", count=count)


def _size(width: int, height: int) -> str:
    return f"{width} × {height}"


def _format_bytes(size: float) -> str:
    """Bytes as a person reads them."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(size / 1e6, 1):.0f} MB"
