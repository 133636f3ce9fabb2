"""What made a frame: a line for the log, and the same as metadata of its files."""

from __future__ import annotations

from typing import Any

from xrds_core.version import package_version

from ..planning.plan import GUIDE_CACHE, Decision
from ..planning.settings import Settings
from .picture import Picture

PREFIX = "xrds"
# What the plan calls a decision and its value, and what was left out then.
_LEFT_OUT = {
    ("denoise", "skipped"): "denoising",
    ("guides", "none"): "guides",
    ("guide bounces", "0"): "guide bounces",
    ("guide lights", "none sampled"): "light in guides",
    ("guide lights", "lamps alone"): "light in guides but lamps",
    ("motion blur", "skipped"): "motion blur",
    ("network", "without empty parts"): "network on empty parts",
}


def fields(picture: Picture, settings: Settings, samples: int) -> dict[str, str]:
    """Name and value of what made a picture; `samples` are the scene's own."""
    entries = {"version": package_version(), "mode": settings.kind}
    entries["scale"] = str(settings.scale)
    if settings.is_enlarged:
        entries["preset"] = settings.preset
    elif not settings.is_cycles_only:
        entries["preset"] = settings.quality
    entries["samples"] = str(settings.count(samples))
    if settings.is_enlarged:
        entries["guide_samples"] = _decided(picture.plan, "guide samples") or "0"
    if picture.temporal is not None:
        frames = picture.temporal.frames
        entries["frames"] = f"{frames[0]} to {frames[-1]}"
    if picture.device:
        entries["device"] = picture.device
    entries["seconds"] = f"{picture.seconds.get('total', 0.0):.1f}"
    entries["left_out"] = ", ".join(_left_out(picture.plan)) or "nothing"
    return entries


def line(entries: dict[str, str], frame: int, layer: str) -> str:
    """The fields as one line of a log."""
    rest = [
        f"{name.replace('_', ' ')} {value}"
        for name, value in entries.items()
        if name not in _NAMELESS
    ]
    head = f"XRDS {entries['version']}, frame {frame}, {layer}: {entries['mode']}"
    return ", ".join([head, *rest])


_NAMELESS = ("version", "mode")


def metadata(entries: dict[str, str], layer: str = "") -> dict[str, str]:
    """The fields by their names in files: with the layer's, as Cycles names its own.

    Files of one picture, as commands write them, have no layers.
    """
    prefix = f"{PREFIX}.{layer}." if layer else f"{PREFIX}."
    return {prefix + name: value for name, value in entries.items()}


def stamp(engine: Any, entries: dict[str, str], layer: str) -> None:
    """Let Blender write the fields into every file that it makes of the result."""
    result = engine.get_result()
    for name, value in metadata(entries, layer).items():
        result.stamp_data_add_field(name, value)


def _decided(plan: tuple[Decision, ...], name: str) -> str | None:
    return next((each.value for each in plan if each.decision == name), None)


def _left_out(plan: tuple[Decision, ...]) -> list[str]:
    found = [_LEFT_OUT.get((each.decision, each.value)) for each in plan]
    cached = _decided(plan, GUIDE_CACHE) or ""
    if cached.startswith("used"):
        found.append("guides, from the cache")
    return [words for words in found if words]
