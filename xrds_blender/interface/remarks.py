"""What the panel says about a scene before it is rendered."""

from __future__ import annotations

from typing import Any

import bpy

from ..frame.job import RenderJob
from ..frame.means import weights_headers
from ..frame.ways import asked_of
from ..planning.ways import WAYS, Means, Way, missing
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
    "Denoise, or choose another way"
)
NO_BUDGET = "A time budget needs a denoiser: install XRDS from its zip"
OTHER_PASSES = (
    "The network was trained with an earlier Blender: from 5.1 on gloss and clear coat "
    "can look wrong. Full Size is not affected"
)
PASSES_CHANGED = (5, 1)
"""The Blender since which the denoising passes leave out what gloss reflects."""
Remark = tuple[str, str]


def remarks(scene: Any, job: RenderJob, at_hand: Means) -> list[Remark]:
    """Icon and sentence: what is missing first, then what is otherwise than usual."""
    settings = scene.xrds
    chosen = Way.of(job.scale, job.plain)
    asked = asked_of(scene, job)
    lacks = {way: missing(way, asked, at_hand) for way in WAYS}
    told: list[Remark] = []
    if settings.is_timed:
        if not at_hand.any_denoiser:
            told.append(("ERROR", NO_BUDGET))
    elif lacks[chosen]:
        told.append(("ERROR", lacks[chosen]))
    else:
        told += [("ERROR", sentence) for sentence in _wrong(scene, chosen, at_hand)]
    not_offered = {text for way, text in lacks.items() if text and way is not chosen}
    told += [
        ("INFO", text) for text in sorted(not_offered) if ("ERROR", text) not in told
    ]
    if job.is_enlarged:
        if not _knows_passes(job):
            told.append(("ERROR", OTHER_PASSES))
        told += [("INFO", sentence) for sentence in support.notes(scene)]
    return told


def _wrong(scene: Any, way: Way, at_hand: Means) -> list[str]:
    """What spoils the picture, though it can be rendered."""
    if way is Way.PLAIN and scene.cycles.use_denoising and not at_hand.cycles_denoiser:
        return [CYCLES_CANNOT_DENOISE]
    if at_hand.any_denoiser:
        return []
    return [NOISY_INPUT if way.is_enlarged else NO_DENOISER]


def _knows_passes(job: RenderJob) -> bool:
    """Whether the weights were trained on denoising passes as this Blender has them."""
    wanted = (job.preset, job.scale)
    series = {
        (each.preset, each.scale): each.blender_series
        for each in weights_headers(job.weights)
    }.get(wanted, "")
    if not series:
        return True
    trained = tuple(int(part) for part in series.split(".")[:2])
    return (trained >= PASSES_CHANGED) == (bpy.app.version[:2] >= PASSES_CHANGED)
