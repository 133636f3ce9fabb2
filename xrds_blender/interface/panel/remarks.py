"""What the panel says about a scene before it is rendered."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy

from ...choosing.capabilities import weights_headers
from ...planning.estimates import Capabilities, missing
from ...planning.request import Request
from ...planning.settings import MODES, Mode
from . import support

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
NO_BUDGET = "A time budget needs a denoiser: install XRDS from its zip"
OTHER_PASSES = (
    "The network was trained with an earlier Blender: from 5.1 on gloss and clear coat "
    "can look wrong. Full Size is not affected"
)
PASSES_CHANGED = (5, 1)
"""The Blender since which the denoising passes leave out what gloss reflects."""
Remark = tuple[str, str]


def remarks(scene: Any, request: Request, here: Capabilities) -> list[Remark]:
    """Icon and sentence: what is missing first, then what is otherwise than usual."""
    settings, chosen = scene.xrds, request.settings.mode
    lacks = {m: missing(replace(request.settings, mode=m), here) for m in MODES}
    found: list[Remark] = []
    if settings.is_timed:
        if not here.any_denoiser:
            found.append(("ERROR", NO_BUDGET))
    elif lacks[chosen]:
        found.append(("ERROR", lacks[chosen]))
    else:
        found += [("ERROR", sentence) for sentence in _wrong(scene, chosen, here)]
    not_offered = {text for mode, text in lacks.items() if text and mode is not chosen}
    found += [
        ("INFO", text) for text in sorted(not_offered) if ("ERROR", text) not in found
    ]
    if request.settings.is_enlarged:
        if not _knows_passes(request):
            found.append(("ERROR", OTHER_PASSES))
        found += [("INFO", sentence) for sentence in support.notes(scene)]
    return found


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
        (each.preset, each.scale): each.blender_series
        for each in weights_headers(request.machine.weights)
    }.get(request.settings.network, "")
    if not series:
        return True
    trained = tuple(int(part) for part in series.split(".")[:2])
    return (trained >= PASSES_CHANGED) == (bpy.app.version[:2] >= PASSES_CHANGED)
