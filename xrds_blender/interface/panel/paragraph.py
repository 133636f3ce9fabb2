"""Sentences in as many lines as they need: one label would be cut off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy

MARGIN = 60.0  # pixels beside the text at an interface scale of 1: icon and frames
_CJK = 0x2E80  # from here on a line may end after any letter


def draw(
    layout: Any, context: Any, text: str, icon: str = "NONE", share: float = 1.0
) -> None:
    """Draw a translated sentence, as wide as a share of the region."""
    system = context.preferences.system
    width = share * (context.region.width - MARGIN * system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in lines(text, width, _measure(context)):
        column.label(text=line, icon=icon, translate=False)
        icon = "NONE" if icon == "NONE" else "BLANK1"


def lines(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """The text in lines of at most `width`, by `measure`; a long word alone."""
    finished, line = [], ""
    for part in _parts(text):
        if line and measure((line + part).rstrip()) > width:
            finished.append(line.rstrip())
            line = ""
        line += part
    return [*finished, line.rstrip()] if line.strip() else finished


def _parts(text: str) -> Iterator[str]:
    """Words with the space behind them, and letters of languages without spaces."""
    word = ""
    for letter in text:
        if ord(letter) >= _CJK and word:
            yield word
            word = ""
        word += letter
        if letter == " " or ord(letter) >= _CJK:
            yield word
            word = ""
    yield word


def _measure(context: Any) -> Callable[[str], float]:
    """Width in pixels of a text in the interface's font."""
    import blf

    points = context.preferences.ui_styles[0].widget.points
    blf.size(0, points * context.preferences.system.ui_scale)
    return lambda text: blf.dimensions(0, text)[0]


def translated(text: str, /, **values: object) -> str:
    """A text of the panel in the interface's language, with values put in."""
    from ..translations import CONTEXT

    translation = bpy.app.translations.pgettext_iface(text, CONTEXT)
    return translation.format(**values) if values else translation
