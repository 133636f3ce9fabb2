"""Cycles' own panels and menus, shown under XRDS too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from .operators import ENGINE


def cycles_classes(base: Any = None) -> Iterator[Any]:
    """All registered panels and menus that name Cycles."""
    for root in (base,) if base else (bpy.types.Panel, bpy.types.Menu):
        for found in root.__subclasses__():
            if "CYCLES" in getattr(found, "COMPAT_ENGINES", ()):
                yield found
            yield from cycles_classes(found)


def register() -> None:
    """Show them under XRDS."""
    for found in cycles_classes():
        found.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Take that back."""
    for found in cycles_classes():
        found.COMPAT_ENGINES.discard(ENGINE)
