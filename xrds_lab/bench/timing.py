"""Stopwatch for whole frames: tasks taken in turns, every run kept in a file.

Windows are never timed: loading the denoiser and syncing the scene would rule them.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from xrds_core.atomic import write_json

from .inputs import GENERATION

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from .inputs import Say
    from .windows import Shot

    Stages = dict[str, float]

ROUNDS = 3


@dataclass
class Task:
    """Something timed; what its call returns as a dict are its own stages."""

    call: Callable[[], object]
    warm: bool  # whether the first call of a process is thrown away

    def run(self) -> Stages:
        """Stages, with total and CPU seconds where the call does not tell them."""
        if self.warm:
            self.call()
            self.warm = False
        wall, cpu = time.perf_counter(), time.process_time()
        stages = self.call()
        clocked = {
            "total": time.perf_counter() - wall,
            "cpu": time.process_time() - cpu,
        }
        return clocked | (stages if isinstance(stages, dict) else {})


class FrameTimes:
    """Runs of named tasks for one scene's whole frame.

    Runs already in the folder are not repeated, so more rounds add to them.
    """

    def __init__(self, shot: Shot, directory: Path | None, say: Say) -> None:
        self.shot, self.say = shot, say
        self.tasks: dict[str, Task] = {}
        self.path = None if directory is None else directory / _file_name(shot)
        self.runs: dict[str, list[Stages]] = {}
        if self.path is not None and self.path.is_file():
            self.runs = json.loads(self.path.read_text("utf-8"))

    def add(self, name: str, call: Callable[[], object], warm: bool = False) -> None:
        """Put a task on the list, once."""
        self.tasks.setdefault(name, Task(call, warm))

    def measure(self, rounds: int) -> None:
        """Run every task ``rounds`` times, one after the other, round by round."""
        for turn in range(rounds):
            for name, task in self.tasks.items():
                runs = self.runs.setdefault(name, [])
                if len(runs) <= turn:
                    runs.append(task.run())
                    self._save()
                    total = runs[-1]["total"]
                    self.say(f"{self.shot.name}: whole frame, {name}: {total:.2f} s")

    def median(self, name: str) -> Stages:
        """Median of every stage over the runs of a task."""
        runs = self.runs[name]
        return {key: statistics.median(run[key] for run in runs) for key in runs[0]}

    def _save(self) -> None:
        if self.path is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_json(self.path, self.runs)


def _file_name(shot: Shot) -> str:
    import bpy

    frame = f"{shot.window.frame_width}x{shot.window.frame_height}"
    machine = f"{platform.machine()}-{os.cpu_count()}cpu"
    version = f"v{GENERATION}-blender{bpy.app.version_string.replace(' ', '')}"
    return f"{shot.name}-{shot.digest}-{frame}-seconds-{machine}-{version}.json"
