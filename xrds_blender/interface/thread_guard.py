"""Keeps Blender's guard against writes from staying shut after a render in a window.

While a panel draws, Blender forbids Python to write; every call into a class notes
whether writing was forbidden before, and restores that after. The note is one for all
threads. Should the render thread enter our engine in the middle of a panel's drawing,
it would restore "forbidden" at its end, and scripts, timers and add-ons could write
nothing more. So while a render runs, Python does not switch threads on its own,
except inside our engine's own work.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy

from ..internals.engine_override import ENGINE
from ..internals.lifetimes import PROCESS

_PATIENT = 5.0  # seconds; far longer than any drawing takes


@dataclass
class _Guard:
    """The usual seconds between switches of threads, while they are others."""

    usual: float | None = None


@bpy.app.handlers.persistent
def _begin(scene: Any, *_: Any) -> None:
    guard = PROCESS.of(_Guard)
    if scene is not None and scene.render.engine == ENGINE and guard.usual is None:
        guard.usual = sys.getswitchinterval()
        sys.setswitchinterval(_PATIENT)


@bpy.app.handlers.persistent
def _end(*_: Any) -> None:
    guard = PROCESS.of(_Guard)
    if guard.usual is not None:
        sys.setswitchinterval(guard.usual)
        guard.usual = None


@contextmanager
def shared() -> Iterator[None]:
    """Let threads take turns as usual inside the engine's work."""
    usual = PROCESS.of(_Guard).usual
    if usual is not None:
        sys.setswitchinterval(usual)
    try:
        yield
    finally:
        if usual is not None:
            sys.setswitchinterval(_PATIENT)


def register() -> None:
    """Listen to Blender's renders."""
    handlers = bpy.app.handlers
    handlers.render_init.append(_begin)
    handlers.render_complete.append(_end)
    handlers.render_cancel.append(_end)


def unregister() -> None:
    """Listen no more."""
    _end()
    handlers = bpy.app.handlers
    handlers.render_init.remove(_begin)
    handlers.render_complete.remove(_end)
    handlers.render_cancel.remove(_end)
