"""The choice of the way, with what to expect of each beside it."""

from __future__ import annotations

from typing import Any

from xrds_core.time_left import duration

from ..planning.ways import WAYS, Outlook, Way
from .paragraph import translated
from .translations import CONTEXT

NAMES = {
    Way.AUTOMATIC: "Automatic",
    Way.FULL_SIZE: "Full Size",
    Way.X2: "Super-Resolution 2×",
    Way.X4: "Super-Resolution 4×",
    Way.X8: "Super-Resolution 8×",
    Way.PLAIN: "Plain",
}
SAME = 0.05  # dB: what is shown as one decimal of zero


def draw(layout: Any, settings: Any, best: Way, looks: list[Outlook]) -> None:
    """Draw one button for each way that can work, and the chosen one in any case."""
    column = layout.column(align=True)
    text = f"{translated('Automatic')} ({_automatic(settings, best)})"
    column.prop_enum(settings, "way", Way.AUTOMATIC.value, text=text, translate=False)
    timed = any(look.seconds is not None for look in looks)
    way, seconds, quality = _cells(column, timed)
    way.label(text="")
    if timed:
        seconds.label(text="About", text_ctxt=CONTEXT)
    quality.label(text="Quality", text_ctxt=CONTEXT)
    found = {look.way: look for look in looks}
    shown = [way for way in WAYS if way in found or settings.way == way]
    enlarged = [way for way in shown if way.is_enlarged]
    for each in shown:
        if each is Way.PLAIN:
            column.separator(factor=0.5)
        if each in enlarged[:1]:
            column.label(text="Super-Resolution", text_ctxt=CONTEXT)
        _draw_way(column, settings, found.get(each, Outlook(each)), timed)


def _draw_way(column: Any, settings: Any, look: Outlook, timed: bool) -> None:
    way, seconds, quality = _cells(column, timed)
    # Short: in a narrow panel three buttons would else read the same.
    name = f"{look.way.scale}×" if look.way.is_enlarged else translated(NAMES[look.way])
    way.prop_enum(settings, "way", look.way.value, text=name, translate=False)
    if timed:
        told = "" if look.seconds is None else duration(look.seconds)
        seconds.label(text=told, translate=False)
    quality.label(text=_quality(look), translate=False)


def _cells(layout: Any, timed: bool) -> tuple[Any, Any, Any]:
    """Three columns, or the outer two where no seconds are known."""
    split = layout.split(factor=0.42 if timed else 0.6, align=True)
    way = split.row(align=True)
    rest = split.split(factor=0.44) if timed else split
    cells = [rest.row() for _ in range(2 if timed else 1)]
    for cell in cells:
        cell.alignment = "RIGHT"
    return way, cells[0], cells[-1]


def _automatic(settings: Any, best: Way) -> str:
    if settings.is_timed:
        return translated("within {time}", time=duration(settings.time_budget))
    return translated(NAMES[best])


def _quality(look: Outlook) -> str:
    if look.decibels is None:
        return translated("noisy") if look.way is Way.PLAIN else "?"
    if look.decibels > -SAME:
        return translated("best")
    digits = 1 if look.decibels > -1 else 0
    return f"{look.decibels:.{digits}f} dB".replace("-", "−")
