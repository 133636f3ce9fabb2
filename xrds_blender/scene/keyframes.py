"""The F-curves of an action, in any Blender."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def curves(action: Any, slot: Any = None) -> Iterator[Any]:
    """Those of a slot, or of all; before Blender 4.4 an action has no slots."""
    if not hasattr(action, "layers"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                if slot is None or bag.slot_handle == slot.handle:
                    yield from bag.fcurves
