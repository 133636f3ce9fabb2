"""Cycles' own panels and menus, shown under XRDS too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ..frame.job import ENGINE


def cycles_classes(base: Any = None) -> Iterator[Any]:
    """All registered panels and menus that name Cycles."""
    for root in (base,) if base else (bpy.types.Panel, bpy.types.Menu):
        for panel in root.__subclasses__():
            if "CYCLES" in getattr(panel, "COMPAT_ENGINES", ()):
                yield panel
            yield from cycles_classes(panel)


def register() -> None:
    """Show them under XRDS."""
    for panel in cycles_classes():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Take that back."""
    for panel in cycles_classes():
        panel.COMPAT_ENGINES.discard(ENGINE)
