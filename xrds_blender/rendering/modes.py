"""Which mode makes the picture, and what to expect of each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from xrds_core.pace.worth import measurements

from ..cycles import session
from ..cycles.view import picture_size
from ..planning import budget, shot_figures
from ..planning import estimates as estimating
from ..planning.estimates import Capabilities, Estimate, resolved
from ..planning.offers import Animation, Offers, offers
from ..planning.request import Request
from ..planning.settings import Denoising, Mode, Settings
from ..scene.contents import stands_still
from . import history
from .loading import has_library
from .pace.measuring import price_of_measuring
from .pace.obstacles import obstacle
from .sampling import has_neighbours

BEST = Denoising.XRDS_HIGH
"""What automatic takes: `best` doubles the seconds for 0.2 to 0.3 decibels."""


def estimates(
    scene: Any, settings: Settings, here: Capabilities, shot: bool = False
) -> list[Estimate]:
    """What to expect of each mode that can work, at the scene's present samples.

    In a `shot` frames have the samples of their neighbours.
    """
    radius = settings.temporal_radius if shot else 0
    known, gain = history.scene_settings(scene), 0.0
    if radius:
        samples = settings.samples or known.samples
        is_still = stands_still(scene.camera)
        gain = shot_figures.shipped().gain(samples, radius, is_still)
    return estimating.estimates(
        settings,
        known,
        here,
        budget.shipped(),
        lambda resolved: history.seconds(scene, resolved, radius),
        gain,
    )


def offers_of(scene: Any, request: Request, frames: int) -> Offers:
    """What Cycles takes for an animation of so many frames, and what XRDS offers."""
    settings, known = request.settings, history.scene_settings(scene)
    radius = settings.temporal_radius
    if not has_neighbours(scene, request) or settings.mode is not Mode.FULL_SIZE:
        radius = 0
    ours = replace(settings, share=1.0, samples=None)
    by_cycles = replace(ours, mode=Mode.CYCLES_ONLY, denoising=None)
    cycles = history.seconds(scene, resolved(by_cycles, known))
    whole = resolved(ours, known)

    one, two = (
        history.seconds(scene, replace(whole, samples=n), radius) for n in (1, 2)
    )
    sample = 0.0 if one is None or two is None else two - one
    price = price_of_measuring(picture_size(scene.render)[::-1])
    animation = Animation(
        frames,
        known.samples,
        cycles,
        fixed=None if one is None else one - sample,
        sample=sample,
        radius=radius,
        is_still=bool(radius) and stands_still(scene.camera),
        is_noisy=not (scene.cycles.use_denoising and session.has_denoiser()),
        has_threshold=scene.cycles.use_adaptive_sampling,
        obstacle=obstacle(scene, request, frames),
        share=history.share(scene),
        measuring=measurements(frames, 2 * radius, price) * price,
    )
    curves = budget.shipped().errors.full_size
    curve = curves.get(BEST) or next(iter(curves.values()))
    return offers(animation, curve, shot_figures.shipped())


def in_mode(request: Request, mode: Mode) -> Request:
    """The request in a mode; automatic is full size wherever it can work."""
    if mode is Mode.AUTOMATIC:
        # which Cycles alone cannot keep
        paced = request.deadline is not None or request.time_budget is not None
        mode = estimating.automatic(paced or has_library())
        request = request.with_settings(denoising=BEST)
    if mode is Mode.CYCLES_ONLY:
        return request.with_settings(mode=mode, temporal_radius=0)
    return request.with_settings(mode=mode)
