"""A picture beside that of Cycles at the same samples, in a word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...planning.estimates import Capabilities, Estimate
from ...planning.settings import Mode
from .paragraph import translated

# In dB of PSNR; half a one is hardly seen.
_ALIKE, _SOFTER = 0.5, 2.0


def of(
    mode: Mode, estimates: Sequence[Estimate], scene: Any, here: Capabilities
) -> str:
    """The word for a mode, of estimates as the scene is set."""
    denoises = scene.cycles.use_denoising and here.cycles_denoiser
    if mode is Mode.CYCLES_ONLY:
        return translated("as set") if denoises else translated("noisy")
    if not denoises:
        return translated("cleaner")
    above = _above(mode, estimates)
    if above is None:
        return translated("not measured")
    if above >= _ALIKE:
        return translated("cleaner")
    if above > -_ALIKE:
        return translated("same")
    soft = above > -_SOFTER
    return translated("softer") if soft else translated("much softer")


def _above(mode: Mode, estimates: Sequence[Estimate]) -> float | None:
    """How far above Cycles' picture a mode's is expected; None where unknown."""
    found = {each.mode: each.decibels for each in estimates}
    ours, cycles = found.get(mode), found.get(Mode.CYCLES_ONLY)
    return None if ours is None or cycles is None else ours - cycles
