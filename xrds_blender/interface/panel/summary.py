"""What the next render will do, and what the last one did, in rows of two words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy

from xrds_core.progress import duration

from ...cycles.view import frame_size
from ...planning import estimates
from ...planning.estimates import Capabilities, Estimate, resolved
from ...planning.plan import Plan
from ...planning.request import Request
from ...planning.settings import Mode, Settings
from ...rendering import history
from ...rendering.history import LastRender, scene_settings
from ...rendering.modes import frame_seconds
from ...rendering.pace.same_picture import can_save
from ...rendering.sampling import has_neighbours
from ...scene.contents import frame_range
from ..preference_values import preference_values
from ..properties import DENOISE
from . import mode_table, paragraph
from .mode_table import NAMES
from .paragraph import translated

if TYPE_CHECKING:
    from .messages import FactsCache


Row = tuple[str, str]
MOST_ROWS = 6
_STAGES = {
    "sync": "Scene",
    "beauty": "Samples",
    "accumulate": "Neighbouring Frames",
    "denoise": "Denoising",
    "guides": "Guides",
    "network": "Network",
    "write": "Writing",
    "total": "Total",
}
_QUALITIES = {quality: label for quality, label, _ in DENOISE}


@lru_cache(maxsize=1)
def _facts_cache() -> FactsCache:
    """Made when a panel is first drawn: Blender starts faster without its modules."""
    from .messages import FactsCache

    return FactsCache()


def forget() -> None:
    """Something in the scene has changed."""
    if _facts_cache.cache_info().currsize:
        _facts_cache().forget()


def is_animation(scene: Any) -> bool:
    """Whether the scene's range has several frames, and something changes in them."""
    if scene.frame_end <= scene.frame_start:
        return False
    return bool(_facts_cache().of_scene(scene, scene.view_layers[0]).moving)


def is_shot(scene: Any, request: Request) -> bool:
    """Whether it is an animation whose frames use each other's samples."""
    return is_animation(scene) and has_neighbours(scene, request)


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
    if not is_shot(scene, request):
        return []
    text = "{radius} before and after, {memory}"
    taken = _format_bytes(estimates.shot_memory(*size, radius, request.settings.scale))
    shown = translated(text, radius=radius, memory=taken)
    return [("Neighbouring Frames", shown)]


def _named(settings: Settings) -> str:
    """Mode and samples."""
    return f"{translated(NAMES[settings.mode])}, {_samples(settings.samples or 0)}"


def _rows_of_enlarged(scene: Any, request: Request) -> list[Row]:
    facts = _facts_cache().facts(scene, bpy.context.view_layer, request.settings)
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


UNKNOWN = "Known after a first render of a frame"
EXPECTED = "Expected from the renders of this file so far"
ALONE = (
    "Frames of this camera, or without a temporal radius and strength, cannot use each "
    "other's samples: each is rendered by itself"
)
STILLS = "Frames help each other in animations, not in single images"


@dataclass(frozen=True)
class Expected:
    """An animation before it is rendered.

    `cycles` and `ours` are the seconds of a frame, None where nothing is known; the
    latter are `at_most` so many where samples are saved. `picture` is ours beside that
    of Cycles. `is_shot` tells whether frames use each other's samples.
    """

    frames: int
    cycles: float | None
    ours: float | None
    picture: str
    at_most: bool = False
    is_shot: bool = True


def expected(
    scene: Any,
    request: Request,
    here: Capabilities,
    estimated: Sequence[Estimate],
) -> Expected:
    """What to expect of the scene's range, from the modes `estimated` for a shot."""
    frames = len(frame_range(scene))
    is_shot = has_neighbours(scene, request)
    known = history.scene_settings(scene)
    settings = request.settings
    cycles = resolved(replace(settings, mode=Mode.CYCLES_ONLY, denoising=None), known)
    saves = can_save(scene, request, frames)
    radius = settings.temporal_radius if is_shot else 0
    ours = frame_seconds(scene, resolved(settings, known), radius)
    if request.deadline is not None:
        ours = request.deadline / frames
    picture = mode_table.word_for(settings.mode, estimated, scene, here)
    return Expected(
        frames,
        history.seconds(scene, cycles),
        ours,
        translated("same") if saves else picture,
        saves,
        is_shot,
    )


def draw(layout: Any, context: Any, times: Expected) -> None:
    """Draw what it takes in Cycles and in XRDS, and where that is from."""
    column = layout.column(align=True)
    title = translated("Animation, {count} frames", count=times.frames)
    column.label(text=title, translate=False)
    limit = "≤ " if times.at_most else ""
    rows = [
        ("Cycles", _format_times(times.cycles, times.frames)),
        ("XRDS", _format_times(times.ours, times.frames, limit)),
        (translated("Picture"), times.picture),
    ]
    for name, value in rows:
        split = column.split(factor=0.3)
        split.label(text=name, translate=False)
        split.label(text=value, translate=False)
    known = None not in (times.cycles, times.ours)
    notes = [EXPECTED if known else UNKNOWN, STILLS if times.is_shot else ALONE]
    for note in notes:
        paragraph.draw(layout, context, translated(note))


def _format_times(seconds: float | None, frames: int, limit: str = "") -> str:
    """The time of all frames, and of one."""
    if seconds is None:
        return "?"
    whole, per_frame = limit + duration(seconds * frames), duration(seconds)
    return translated("{whole}, a frame {each}", whole=whole, each=per_frame)
