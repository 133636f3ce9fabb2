"""The last renders of each scene: what they were, and what they tell of the next.

Remembered for as long as Blender runs and the file is open, for the panel to show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..cycles import session
from ..cycles.view import picture_size
from ..internals.lifetimes import FILE
from ..planning import budget
from ..planning.budget import Costs
from ..planning.estimates import Measured, SceneSettings, learn, resolved
from ..planning.settings import Denoising, Settings


@dataclass(frozen=True)
class Layer:
    """A view layer that is rendered; read before Cycles frees the evaluated scene."""

    scene: str
    name: str
    pixels: int
    settings: SceneSettings


@dataclass(frozen=True)
class LastRender:
    """What the last render was, with nothing left open, and its seconds by stage.

    `devices` are what its stages ran on, as far as that is known.
    """

    settings: Settings
    seconds: Mapping[str, float]
    devices: Mapping[str, str] = field(default_factory=dict)


@dataclass
class _Known:
    """Of all scenes of a file, by name of the scene and of the view layer."""

    last: dict[str, dict[str, LastRender]] = field(default_factory=dict)
    measured: dict[str, dict[str, Measured]] = field(default_factory=dict)


def layer_of(depsgraph: Any) -> Layer:
    """The layer that a dependency graph is of."""
    scene = depsgraph.scene_eval
    width, height = picture_size(scene.render)
    name = depsgraph.view_layer_eval.name
    return Layer(scene.name, name, width * height, scene_settings(scene))


def scene_settings(scene: Any) -> SceneSettings:
    """What a scene has where settings leave it open."""
    return SceneSettings(scene.cycles.samples, _denoising(scene))


def _denoising(scene: Any) -> Denoising | None:
    """Cycles' own; None where it denoises by none of its modes."""
    cycles = scene.cycles
    if not (cycles.use_denoising and session.has_denoiser()):
        return None
    if cycles.denoiser != "OPENIMAGEDENOISE":
        return None
    return Denoising(f"{cycles.denoising_quality}-{cycles.denoising_prefilter}")


def remember(
    layer: Layer,
    settings: Settings,
    seconds: Mapping[str, float],
    devices: Mapping[str, str] | None = None,
) -> None:
    """Remember a finished render, `devices` as of `LastRender`."""
    settings, seconds = resolved(settings, layer.settings), dict(seconds)
    known, last = FILE.of(_Known), LastRender(settings, seconds, devices or {})
    known.last.setdefault(layer.scene, {})[layer.name] = last
    layers = known.measured.setdefault(layer.scene, {})
    before, model = layers.get(layer.name), budget.shipped()
    layers[layer.name] = learn(before, settings, layer.pixels, seconds, model)


def last(scene: Any) -> LastRender | None:
    """The scene's last render since the file was opened: all its layers together."""
    layers = FILE.of(_Known).last.get(scene.name, {})
    done = [layers[x.name] for x in scene.view_layers if x.use and x.name in layers]
    if not done:
        return None
    stages = {stage for render in done for stage in render.seconds}
    seconds = {s: sum(render.seconds.get(s, 0.0) for render in done) for s in stages}
    return replace(done[-1], seconds=seconds)


def seconds(scene: Any, settings: Settings) -> float | None:
    """What a frame of the scene will about take; None where nothing is known.

    The settings are resolved.
    """
    width, height = picture_size(scene.render)
    known = FILE.of(_Known).measured.get(scene.name, {})
    total = 0.0
    for layer in scene.view_layers:
        if not layer.use:
            continue
        if layer.name not in known:
            return None
        spent = known[layer.name].seconds(settings, width * height, budget.shipped())
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
