"""The choice of the mode, with what to expect of each beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from xrds_core.progress import duration

from ...planning.estimates import Capabilities, Estimate
from ...planning.settings import MODES, Mode
from ..translations import CONTEXT
from .paragraph import translated

# In dB of PSNR; half a one is hardly seen.
_ALIKE, _SOFTER = 0.5, 2.0


def word_for(
    mode: Mode, estimates: Sequence[Estimate], scene: Any, here: Capabilities
) -> str:
    """The word for a mode, of estimates as the scene is set."""
    denoises = scene.cycles.use_denoising and here.cycles_denoiser
    if mode is Mode.CYCLES_ONLY:
        return translated("as set") if denoises else translated("noisy")
    if mode is Mode.FULL_SIZE and not denoises:
        return translated("cleaner")
    rival = Mode.CYCLES_ONLY if denoises else Mode.FULL_SIZE
    above = _decibels_above(mode, rival, estimates)
    if above is None:
        return translated("not measured")
    if above >= _ALIKE:
        return translated("cleaner")
    if above > -_ALIKE:
        return translated("same")
    soft = above > -_SOFTER
    return translated("softer") if soft else translated("much softer")


def _decibels_above(
    mode: Mode, rival: Mode, estimates: Sequence[Estimate]
) -> float | None:
    """How far above another's picture a mode's is expected; None where unknown."""
    decibels = {estimate.mode: estimate.decibels for estimate in estimates}
    ours, theirs = decibels.get(mode), decibels.get(rival)
    return None if ours is None or theirs is None else ours - theirs


NAMES = {
    Mode.AUTOMATIC: "Automatic",
    Mode.FULL_SIZE: "Full Size",
    Mode.X2: "Super-Resolution 2×",
    Mode.X4: "Super-Resolution 4×",
    Mode.X8: "Super-Resolution 8×",
    Mode.CYCLES_ONLY: "Cycles Only",
}


def draw(
    layout: Any, scene: Any, here: Capabilities, best: Mode, estimates: list[Estimate]
) -> None:
    """Draw one button for each mode that can work, and the chosen one in any case."""
    settings = scene.xrds
    column = layout.column(align=True)
    text = f"{translated('Automatic')} ({_automatic(settings, best)})"
    column.prop_enum(settings, "mode", Mode.AUTOMATIC.value, text=text, translate=False)
    timed = any(estimate.seconds is not None for estimate in estimates)
    mode, seconds, quality = _cells(column, timed)
    mode.label(text="")
    if timed:
        seconds.label(text="Time", text_ctxt=CONTEXT)
    quality.label(text="Picture", text_ctxt=CONTEXT)
    by_mode = {estimate.mode: estimate for estimate in estimates}
    shown = [mode for mode in MODES if mode in by_mode or settings.mode == mode]
    enlarged = [mode for mode in shown if mode.is_enlarged]
    for shown_mode in shown:
        if shown_mode is Mode.CYCLES_ONLY:
            column.separator(factor=0.5)
        if shown_mode in enlarged[:1]:
            column.label(text="Super-Resolution", text_ctxt=CONTEXT)
        word = word_for(shown_mode, estimates, scene, here)
        _draw_mode(
            column, settings, by_mode.get(shown_mode, Estimate(shown_mode)), word, timed
        )


def _draw_mode(
    column: Any, settings: Any, estimate: Estimate, word: str, timed: bool
) -> None:
    cell, seconds, quality = _cells(column, timed)
    mode = estimate.mode
    # Short: in a narrow panel three buttons would else read the same.
    name = f"{mode.scale}×" if mode.is_enlarged else translated(NAMES[mode])
    cell.prop_enum(settings, "mode", mode.value, text=name, translate=False)
    if timed:
        spent = estimate.seconds
        text = "" if spent is None else duration(spent)
        seconds.label(text=text, translate=False)
    quality.label(text=word, translate=False)


def _cells(layout: Any, timed: bool) -> tuple[Any, Any, Any]:
    """Three columns, or the outer two where no seconds are known."""
    split = layout.split(factor=0.42 if timed else 0.6, align=True)
    first = split.row(align=True)
    rest = split.split(factor=0.44) if timed else split
    cells = [rest.row() for _ in range(2 if timed else 1)]
    for cell in cells:
        cell.alignment = "RIGHT"
    return first, cells[0], cells[-1]


def _automatic(settings: Any, best: Mode) -> str:
    if settings.is_timed:
        return translated("within {time}", time=duration(settings.time_budget))
    return translated(NAMES[best])
