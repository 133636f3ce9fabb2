"""The last renders of each scene: what they were, and what they tell of the next.

Remembered for as long as Blender runs and the file is open, for the panel to show.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..cycles import session
from ..cycles.view import picture_size
from ..internals.lifetimes import FILE, RENDER_JOB
from ..planning import budget
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


@dataclass
class _Frames:
    """How many frames of a render job were remembered, by scene and view layer."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)


def remember(
    layer: Layer,
    settings: Settings,
    seconds: Mapping[str, float],
    devices: Mapping[str, str] | None = None,
    share: float | None = None,
) -> None:
    """Remember a finished render, `devices` as of `LastRender`, `share` of `Measured`.

    What is known of an animation is the mean of its frames so far.
    """
    counts = RENDER_JOB.of(_Frames).counts
    counts[layer.scene, layer.name] += 1
    frame = counts[layer.scene, layer.name]
    settings, seconds = resolved(settings, layer.settings), dict(seconds)
    known, last = FILE.of(_Known), LastRender(settings, seconds, devices or {})
    known.last.setdefault(layer.scene, {})[layer.name] = last
    layers = known.measured.setdefault(layer.scene, {})
    before, model = layers.get(layer.name), budget.shipped()
    layers[layer.name] = learn(
        before, settings, layer.pixels, seconds, model, frame=frame, share=share
    )


def last(scene: Any) -> LastRender | None:
    """The scene's last render since the file was opened: all its layers together."""
    layers = FILE.of(_Known).last.get(scene.name, {})
    done = [layers[x.name] for x in scene.view_layers if x.use and x.name in layers]
    if not done:
        return None
    stages = {stage for render in done for stage in render.seconds}
    seconds = {s: sum(render.seconds.get(s, 0.0) for render in done) for s in stages}
    return replace(done[-1], seconds=seconds)


def seconds(scene: Any, settings: Settings, radius: int = 0) -> float | None:
    """What a frame of the scene will about take; None where nothing is known.

    The settings are resolved; `radius` frames before and after are reused.
    """
    width, height = picture_size(scene.render)
    model, total = budget.shipped(), 0.0
    for known in _measured(scene):
        if known is None:
            return None
        spent = known.seconds(settings, width * height, model, radius)
        if spent is None:
            return None
        total += spent
    return total


def share(scene: Any) -> float | None:
    """How much of the file's samples frames took in the last *Same Picture*."""
    shares = (known.share for known in _measured(scene) if known)
    return max((share for share in shares if share is not None), default=None)


def _measured(scene: Any) -> list[Measured | None]:
    """What is known of each layer that is rendered."""
    known = FILE.of(_Known).measured.get(scene.name, {})
    return [known.get(layer.name) for layer in scene.view_layers if layer.use]
