"""What a running render is doing now.

Blender asks an engine for nothing like this, so it is kept here for the status bar to
show.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..cycles import session

LOW, GUIDES, NETWORK = "Low resolution", "Guides", "Network"
SAMPLES, DENOISE = "Samples", "Denoising"
STAGES = (
    "total",
    "sync",
    "beauty",
    "accumulate",
    "denoise",
    "guides",
    "network",
    "write",
)

_current: str | None = None
_frames_left: str = ""


def begin(engine: Any, stage: str, number: int, of: int = 3) -> None:
    """Note that the stage of this number has begun."""
    global _current
    _current = f"XRDS {number}/{of}: {stage}"
    engine.update_stats("XRDS", stage)
    engine.update_progress(0.0)


def begin_frame(number: int, left: int, seconds: float | None = None) -> None:
    """Note which frame of an animation has begun, and what is left after it.

    `seconds`: an estimate for this frame and those after it; None without one.
    """
    global _frames_left
    rest = "the last one" if not left else f"{left} left"
    if seconds is not None:
        rest += f", about {_time(seconds)}"
    _frames_left = f"Frame {number} ({rest}). "


def _time(seconds: float) -> str:
    minutes = round(seconds / 60)
    if minutes < 1:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 90 else f"{minutes / 60:.1f} h"


def reporter(engine: Any) -> Callable[[float], bool]:
    """Shows how far a stage is, from 0 to 1; False once the user has stopped it."""

    def report(done: float) -> bool:
        engine.update_progress(done)
        return not session.is_stopped(engine)

    return report


def end() -> None:
    """Note that the render is over, however it ended."""
    global _current, _frames_left
    _current, _frames_left = None, ""


def current() -> str | None:
    """What is being done, None between renders."""
    return None if _current is None else _frames_left + _current
