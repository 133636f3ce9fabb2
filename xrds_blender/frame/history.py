"""The last renders of each scene: what they were, and what they tell of the next.

Kept for as long as Blender runs and the file is open, for the panel to show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..cycles import session
from ..cycles.size import picture_size
from ..internals.lifetimes import FILE
from ..planning import budget
from ..planning.budget import Costs
from ..planning.denoiser import Denoiser
from ..planning.measured import Measured, learn
from ..planning.ways import Asked, Way
from .job import Picture, RenderJob


@dataclass(frozen=True)
class Place:
    """What a render is of; read before Cycles frees the evaluated scene."""

    scene: str
    layer: str
    pixels: int
    samples: int
    plain_denoiser: Denoiser | None


@dataclass(frozen=True)
class LastRender:
    """The way and the samples that were taken, and the seconds by stage."""

    way: Way
    samples: int
    seconds: Mapping[str, float]


@dataclass
class _Known:
    """Of all scenes of a file, by name of the scene and of the view layer."""

    last: dict[str, dict[str, LastRender]] = field(default_factory=dict)
    measured: dict[str, dict[str, Measured]] = field(default_factory=dict)


def place_of(depsgraph: Any) -> Place:
    """The place of a render, from its dependency graph."""
    scene = depsgraph.scene_eval
    width, height = picture_size(scene.render)
    return Place(
        scene.name,
        depsgraph.view_layer_eval.name,
        width * height,
        scene.cycles.samples,
        plain_denoiser(scene),
    )


def plain_denoiser(scene: Any) -> Denoiser | None:
    """Cycles' mode in a plain render; None where it denoises by none of them."""
    cycles = scene.cycles
    if not (cycles.use_denoising and session.has_denoiser()):
        return None
    if cycles.denoiser != "OPENIMAGEDENOISE":
        return None
    return Denoiser(f"{cycles.denoising_quality}-{cycles.denoising_prefilter}")


def asked_of(
    job: RenderJob, samples: int, plain_denoiser: Denoiser | None = None
) -> Asked:
    """A job's settings, as far as ways differ by them."""
    return Asked(
        samples=job.samples or samples,
        denoise=job.denoise,
        preset=job.preset,
        guide_samples=job.guide_samples,
        plain_denoiser=job.denoiser or plain_denoiser,
    )


def keep(place: Place, job: RenderJob, picture: Picture) -> None:
    """Remember a finished render."""
    way = Way.of(job.scale, job.plain)
    asked = asked_of(job, place.samples, place.plain_denoiser)
    seconds = dict(picture.seconds)
    done = LastRender(way, asked.samples, seconds)
    known = FILE.of(_Known)
    known.last.setdefault(place.scene, {})[place.layer] = done
    layers = known.measured.setdefault(place.scene, {})
    layers[place.layer] = learn(
        layers.get(place.layer), way, asked, place.pixels, seconds, budget.shipped()
    )


def last(scene: Any) -> LastRender | None:
    """The scene's last render since the file was opened: all its layers together."""
    layers = FILE.of(_Known).last.get(scene.name, {})
    done = [layers[x.name] for x in scene.view_layers if x.use and x.name in layers]
    if not done:
        return None
    stages = {stage for each in done for stage in each.seconds}
    seconds = {s: sum(each.seconds.get(s, 0.0) for each in done) for s in stages}
    return replace(done[-1], seconds=seconds)


def seconds(scene: Any, way: Way, asked: Asked) -> float | None:
    """What a frame of the scene will about take; None where nothing is known."""
    width, height = picture_size(scene.render)
    known = FILE.of(_Known).measured.get(scene.name, {})
    total = 0.0
    for layer in scene.view_layers:
        if not layer.use:
            continue
        if layer.name not in known:
            return None
        spent = known[layer.name].seconds(way, asked, width * height, budget.shipped())
        if spent is None:
            return None
        total += spent
    return total


def costs(scene: Any) -> Costs | None:
    """Costs of a frame's parts; None where unknown, or for several layers."""
    names = [layer.name for layer in scene.view_layers if layer.use]
    known = FILE.of(_Known).measured.get(scene.name, {})
    if len(names) != 1 or names[0] not in known:
        return None
    width, height = picture_size(scene.render)
    return known[names[0]].costs(width * height, budget.shipped())
