"""What the next render will do, and what the last one did, in rows of two words."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy

from ..cycles.size import frame_size
from ..frame.history import LastRender, plain_denoiser
from ..frame.job import RenderJob
from ..planning import forecast
from ..planning.plan import Plan
from ..planning.ways import Means, Way
from .machine import machine
from .paragraph import translated
from .properties import DENOISE
from .ways_table import NAMES

if TYPE_CHECKING:
    from .facts_cache import FactsCache

Row = tuple[str, str]
MOST_ROWS = 5
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
    from .facts_cache import FactsCache

    return FactsCache()


def forget() -> None:
    """Something in the scene has changed."""
    if _facts_cache.cache_info().currsize:
        _facts_cache().forget()


def next_render(scene: Any, job: RenderJob, at_hand: Means) -> list[Row]:
    """Name and value of what the render will do, take and leave out; five at most."""
    size = frame_size(scene.render)
    if job.is_picked:
        rows = [("Picture", _size(*size)), ("About", _foreseen(scene, job, at_hand))]
        return rows + _neighbours(size, job)
    if job.is_enlarged:
        return _enlarged(scene, job)
    rows = [("Picture", _sampled(*size, scene.cycles.samples))]
    if job.plain:
        mode = plain_denoiser(scene)
        named = mode and f"OIDN {mode.quality.title()}, {mode.prefilter.title()}"
        told = named or translated("none")
        return [*rows, ("Denoising", told)]
    rows.append(("Denoising", translated(_QUALITIES[job.denoise])))
    return rows + _neighbours(size, job)


def _neighbours(size: tuple[int, int], job: RenderJob) -> list[Row]:
    """How many frames an animation keeps, and the memory that they take."""
    if not job.temporal_radius:
        return []
    text = "{radius} before and after, {memory}"
    taken = _amount(forecast.shot_memory(*size, job.temporal_radius, job.scale))
    told = translated(text, radius=job.temporal_radius, memory=taken)
    return [("Neighbouring Frames", told)]


def _foreseen(scene: Any, job: RenderJob, at_hand: Means) -> str:
    """What a time budget will about choose."""
    from ..frame.picking import foresee

    networks = sorted(at_hand.networks) if at_hand.torch else []
    picked = foresee(scene, job, networks) if at_hand.any_denoiser else None
    if picked is None:
        return translated("known after a first render")
    choice = picked.choice
    is_plain = choice.scale == 1 and not choice.denoiser.is_ours
    way = Way.of(choice.scale, is_plain)
    return f"{translated(NAMES[way])}, {_samples(choice.samples)}"


def _enlarged(scene: Any, job: RenderJob) -> list[Row]:
    facts = _facts_cache().facts(scene, bpy.context.view_layer, job)
    chosen = job.plan(facts)
    size = facts.width, facts.height
    small = forecast.low_size(*size, job.scale)
    limit = machine().memory_limit
    taken = forecast.memory(*size, job.preset, job.scale, limit)
    guides = _sampled(*size, chosen.guide_samples)
    rows = [
        ("Small Picture", _sampled(*small, scene.cycles.samples)),
        ("Guides", guides if chosen.render_guides else translated("none")),
        ("Memory", f"≤ {_amount(taken)}"),
        *_neighbours(size, job),
    ]
    left_out = ", ".join(translated(each) for each in _left_out(chosen))
    return [*rows, ("Left Out", left_out)] if left_out else rows


def _left_out(chosen: Plan) -> list[str]:
    """What the scene does not need."""
    parts = {
        "light in the guides": chosen.render_guides and not chosen.guides.sample_world,
        "mirrors in the guides": chosen.render_guides and not chosen.guides.bounces,
        "the denoiser": not chosen.denoise,
        "motion blur": any(
            each.decision == "motion blur" and each.value == "skipped"
            for each in chosen.decisions
        ),
    }
    return [name for name, is_left_out in parts.items() if is_left_out]


def last_render(last: LastRender) -> list[Row]:
    """What the last render was, and where its seconds went."""
    way = f"{translated(NAMES[last.way])}, {_samples(last.samples)}"
    rows = [("Way", way)]
    for stage, name in _STAGES.items():
        spent = last.seconds.get(stage, 0.0)
        if spent >= 0.05 or stage == "total":
            rows.append((_stage(stage, name, last.way), f"{spent:.1f} s"))
    return rows


def _stage(stage: str, name: str, way: Way) -> str:
    """Cycles does not tell its own denoising from its samples."""
    if stage != "beauty":
        return name
    if way.is_enlarged:
        return "Small Picture"
    return "Samples and Denoising" if way is Way.PLAIN else name


def _sampled(width: int, height: int, samples: int) -> str:
    return f"{_size(width, height)}, {_samples(samples)}"


def _samples(count: int) -> str:
    return translated("{count} samples" if count > 1 else "1 sample", count=count)


def _size(width: int, height: int) -> str:
    return f"{width} × {height}"


def _amount(size: float) -> str:
    """Bytes as a person reads them."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(size / 1e6, 1):.0f} MB"
