"""How far Cycles has come, read from the status that it gives to the engine.

Blender keeps an engine's last status line in the engine itself, where Python has no
property for it; listening to every line stalls a window (see `clock`).
"""

from __future__ import annotations

import ctypes
import re
from typing import Any

_SIZE = 576  # bytes of the engine that hold the line; it has more
_SAMPLES = re.compile(rb"Sample (\d+)/(\d+)")
_TILES = re.compile(rb"Rendered (\d+)/(\d+) Tiles")


def fraction(engine: Any) -> float | None:
    """The part of its samples that Cycles has taken; None where it does not say.

    The engine must be rendering.
    """
    text = ctypes.string_at(engine.as_pointer(), _SIZE)
    samples, tiles = _SAMPLES.search(text), _TILES.search(text)
    if samples is None:
        return None
    done = int(samples[1]) / max(int(samples[2]), 1)
    if tiles is not None:
        done = (int(tiles[1]) + done) / max(int(tiles[2]), 1)
    return min(done, 1.0)
