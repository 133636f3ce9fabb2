"""What the panel says of a scene before it is rendered.

What XRDS does otherwise than Cycles, as far as a scene asks for it.

Pure questions to a scene; the panel shows the answers, docs/compatibility.md lists all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import bpy

from ...planning.estimates import Capabilities, missing
from ...planning.request import Request
from ...planning.settings import MODES, Mode
from ...rendering.loading import weights_headers
from ...scene.strength import weak_objects

LIGHTS = ("diffuse", "glossy", "transmission")


def notes_of(scene: Any) -> Iterator[str]:
    """One sentence for each thing that this scene gets otherwise than expected."""
    for asks, sentence in _NOTES:
        if asks(scene):
            yield sentence


def _layers(scene: Any) -> list[Any]:
    return [layer for layer in scene.view_layers if layer.use]


def _uses_light_passes(scene: Any) -> bool:
    names = [f"use_pass_{light}_{bounce}" for light in LIGHTS for bounce in _BOUNCES]
    names += ["use_pass_ambient_occlusion", "use_pass_shadow"]
    own = [f"use_pass_volume_{bounce}" for bounce in _BOUNCES]
    own.append("use_pass_shadow_catcher")
    return any(
        any(getattr(layer, name, False) for name in names)
        or any(getattr(layer.cycles, name, False) for name in own)
        or bool(layer.lightgroups)
        for layer in _layers(scene)
    )


_BOUNCES = ("direct", "indirect")


def _is_panorama(scene: Any) -> bool:
    return scene.camera is not None and scene.camera.data.type == "PANO"


def _has_time_limit(scene: Any) -> bool:
    return bool(scene.cycles.time_limit)


def _has_freestyle(scene: Any) -> bool:
    return bool(scene.render.use_freestyle)


def _has_weak_objects(scene: Any) -> bool:
    return bool(scene.xrds.temporal_radius and weak_objects(scene.objects))


_NOTES: tuple[tuple[Callable[[Any], bool], str], ...] = (
    (
        _uses_light_passes,
        "Light passes are those of the low-resolution picture, enlarged without the "
        "network",
    ),
    (
        _has_time_limit,
        "The time limit covers the low-resolution picture only; guides and network add "
        "to it",
    ),
    (
        _is_panorama,
        "A panorama's low-resolution picture is resampled, so its edges are less sharp",
    ),
    (
        _has_freestyle,
        "Freestyle draws its lines at full size, over the finished picture",
    ),
    (
        _has_weak_objects,
        "The strength of objects counts at Full Size alone, that of the scene always",
    ),
)

NO_DENOISER = (
    "There is no denoiser: the picture keeps its noise. Install XRDS from its zip"
)
NOISY_INPUT = (
    "There is no denoiser: the network gets a noisy picture. Install XRDS from its "
    "zip, or use more samples"
)
CYCLES_CANNOT_DENOISE = (
    "This Blender has no denoiser, so Cycles may stop with an error: switch off its "
    "Denoise, or choose another mode"
)
OTHER_PASSES = (
    "The network was trained with an earlier Blender: from 5.1 on gloss and clear coat "
    "can look wrong. Full Size is not affected"
)
PASSES_CHANGED = (5, 1)
"""The Blender since which the denoising passes leave out what gloss reflects."""
Remark = tuple[str, str]


def remarks(scene: Any, request: Request, here: Capabilities) -> list[Remark]:
    """Icon and sentence: what is missing first, then what is otherwise than usual."""
    chosen = request.settings.mode
    lacks = {m: missing(replace(request.settings, mode=m), here) for m in MODES}
    shown: list[Remark] = []
    if lacks[chosen]:
        shown.append(("ERROR", lacks[chosen]))
    else:
        shown += [("ERROR", sentence) for sentence in _wrong(scene, chosen, here)]
    not_offered = {text for mode, text in lacks.items() if text and mode is not chosen}
    shown += [
        ("INFO", text) for text in sorted(not_offered) if ("ERROR", text) not in shown
    ]
    if request.settings.is_enlarged:
        if not _knows_passes(request):
            shown.append(("ERROR", OTHER_PASSES))
        shown += [("INFO", sentence) for sentence in notes_of(scene)]
    return shown


def _wrong(scene: Any, mode: Mode, here: Capabilities) -> list[str]:
    """What spoils the picture, though it can be rendered."""
    denoises = mode is Mode.CYCLES_ONLY and scene.cycles.use_denoising
    if denoises and not here.cycles_denoiser:
        return [CYCLES_CANNOT_DENOISE]
    if here.any_denoiser:
        return []
    return [NOISY_INPUT if mode.is_enlarged else NO_DENOISER]


def _knows_passes(request: Request) -> bool:
    """Whether the weights were trained on denoising passes as this Blender has them."""
    series = {
        (header.preset, header.scale): header.blender_series
        for header in weights_headers(request.machine.weights)
    }.get(request.settings.network, "")
    if not series:
        return True
    trained = tuple(int(part) for part in series.split(".")[:2])
    return (trained >= PASSES_CHANGED) == (bpy.app.version[:2] >= PASSES_CHANGED)
