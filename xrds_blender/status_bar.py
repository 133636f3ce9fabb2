"""What a running render is doing now, shown in Blender's status bar.

Cycles overwrites the texts that an engine gives Blender; the status bar is our own.
"""

from __future__ import annotations

from typing import Any

LOW, GUIDES, NETWORK = "Low resolution", "Guides", "Network"

_now: str | None = None
_last: dict[str, float] = {}


def begin(engine: Any, stage: str, number: int) -> None:
    """Tell that the stage of this number has begun."""
    global _now
    _now = f"XRDS {number}/3: {stage}"
    engine.update_stats("XRDS", stage)
    engine.update_progress(0.0)


def end() -> None:
    """Tell that the render is over, however it ended."""
    global _now
    _now = None


def keep(seconds: dict[str, float]) -> None:
    """Remember what a finished render took."""
    global _last
    _last = dict(seconds)


def now() -> str | None:
    """What is being done, None between renders."""
    return _now


def last_seconds() -> dict[str, float]:
    """Seconds by stage of the last render since Blender started."""
    return _last


def draw(self: Any, context: Any) -> None:
    """Draw the stage into the status bar."""
    if _now is not None:
        self.layout.label(text=_now)
