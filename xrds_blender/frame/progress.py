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


def begin(engine: Any, stage: str, number: int, of: int = 3) -> None:
    """Note that the stage of this number has begun."""
    global _current
    _current = f"XRDS {number}/{of}: {stage}"
    engine.update_stats("XRDS", stage)
    engine.update_progress(0.0)


def reporter(engine: Any) -> Callable[[float], bool]:
    """Shows how far a stage is, from 0 to 1; False once the user has stopped it."""

    def report(done: float) -> bool:
        engine.update_progress(done)
        return not session.is_stopped(engine)

    return report


def end() -> None:
    """Note that the render is over, however it ended."""
    global _current
    _current = None


def current() -> str | None:
    """What is being done, None between renders."""
    return _current
