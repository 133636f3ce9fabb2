"""Seconds of the stages inside one Cycles render, read from its own status lines.

Blender hands every status line of a background render to the `render_stats` handlers.
In a window nobody listens, and all seconds count as rendering: Cycles reports its
status with the scene locked, and the image editor, which holds Python, waits for that
lock to draw (Blender 5.2 hangs).
"""

from __future__ import annotations

import re
import time
from typing import Any

# What Cycles says once the scene is there; a frame in tiles is read back and denoised
# after its last sample.
_RENDERING = ("Sample ", "Rendered ", "Finish", "Reading full buffer", "Denoising")
_PEAK = re.compile(r"Mem:[\d.]+M, Peak:([\d.]+)M")
_SAMPLE = re.compile(r"Sample (\d+)/")


class StageClock:
    """Times one Cycles render: `sync` (scene and BVH) and `render` seconds.

    `peak` is the largest memory in bytes that Cycles reported, `samples` the most that
    it said it had taken; 0 when it reported none.
    """

    def __init__(self) -> None:
        self._start = self._end = 0.0
        self._sync = self._status = 0.0
        self._syncing = True
        self.peak = self.samples = 0

    def __enter__(self) -> StageClock:
        import bpy

        self._start = self._status = time.perf_counter()
        if bpy.app.background:
            bpy.app.handlers.render_stats.append(self._hear)
        return self

    def __exit__(self, *_: object) -> None:
        import bpy

        self._end = time.perf_counter()
        if bpy.app.background:
            bpy.app.handlers.render_stats.remove(self._hear)

    def _hear(self, line: str, *_: Any) -> None:
        """Add the time since the last line to what Cycles did until now.

        With several views it syncs, samples, and syncs again.
        """
        now = time.perf_counter()
        if self._syncing:
            self._sync += now - self._status
        if match := _PEAK.search(line):
            self.peak = max(self.peak, int(float(match[1]) * 2**20))
        status = line.rpartition("|")[2].strip()
        if match := _SAMPLE.match(status):
            self.samples = max(self.samples, int(match[1]))
        self._status = now
        self._syncing = not status.startswith(_RENDERING)

    @property
    def sync(self) -> float:
        return self._sync

    @property
    def render(self) -> float:
        return self._end - self._start - self._sync
