"""Which mode makes the picture, and what to expect of each."""

from __future__ import annotations

from typing import Any

from ..planning import budget
from ..planning import estimates as estimating
from ..planning.estimates import Capabilities, Estimate
from ..planning.request import Request
from ..planning.settings import Denoising, Mode, Settings
from . import history
from .loading import capabilities

BEST = Denoising.XRDS_HIGH
"""What automatic takes: `best` doubles the seconds for 0.2 to 0.3 decibels."""


def estimates(
    scene: Any, settings: Settings, here: Capabilities, shot: bool = False
) -> list[Estimate]:
    """What to expect of each mode that can work, at the scene's present samples.

    In a `shot` frames have the samples of their neighbours.
    """
    radius = settings.temporal_radius if shot else 0

    def seconds(resolved: Settings) -> float | None:
        return frame_seconds(scene, resolved, radius)

    known, model = history.scene_settings(scene), budget.shipped()
    return estimating.estimates(settings, known, here, model, seconds, radius)


def frame_seconds(scene: Any, resolved: Settings, radius: int) -> float | None:
    """What a frame will about take that reuses `radius` frames before and after.

    None where nothing is known; the settings are resolved.
    """
    costs = history.costs(scene)
    if not radius or costs is None or resolved.is_cycles_only:
        return history.seconds(scene, resolved)
    return costs.in_shot(radius).seconds(resolved)


def in_mode(request: Request, mode: Mode) -> Request:
    """The request in a mode; automatic is full size wherever it can work."""
    if mode is Mode.AUTOMATIC:
        # which Cycles alone cannot keep
        paced = request.deadline is not None or request.time_budget is not None
        here = capabilities(request.machine.weights)
        mode = Mode.FULL_SIZE if paced else estimating.automatic(here)
        request = request.with_settings(denoising=BEST)
    if mode is Mode.CYCLES_ONLY:
        return request.with_settings(mode=mode, temporal_radius=0)
    return request.with_settings(mode=mode)
