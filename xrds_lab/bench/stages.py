"""Seconds of every configuration's whole frame, from stages timed in turns.

A sweep has hundreds of configurations and a frame takes many seconds. So the stages
are timed: two sample counts of each kind of render (Cycles' time is a line in its
samples), each mode of the denoiser, each network. All of them run once per round, in
another order each time, so that a slow minute of the machine hits all. A
configuration's seconds are the sums of its stages' medians; whole frames rendered by
the product stand beside them as a check.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.files import read_json, write_json

from . import machine
from .inputs import OFF, Mode, open_scene
from .sweep import anchor

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from .inputs import Request
    from .journal import Journal, Strict
    from .sweep import Config
    from .windows import Shot

    Run = dict[str, Any]  # seconds, cpu, peak (None if not known) and own stages
    Task = Callable[[], object]

ROUNDS = 3
PLAIN_FRAME, XRDS_FRAME = "whole frame, plain", "whole frame, XRDS"
GUIDE_DENOISER = "denoiser of guides of more"
CYCLES = ("cycles", "oidn", "oidn_adaptive")
STAGES = ("sync", "beauty", "denoise", "guides", "network", "other")


@dataclass
class Cost:
    """Seconds and memory of one configuration's frame."""

    seconds: dict[str, float]
    cpu_seconds: float
    peak_memory: int | None

    @property
    def total(self) -> float:
        """Seconds of the whole frame."""
        return self.seconds["total"]


@dataclass
class StageTimes:
    """Runs of one scene's stages at one frame size, kept in a file."""

    path: Path
    runs: dict[str, list[Run]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path.is_file():
            self.runs = read_json(self.path)

    def add(self, name: str, run: Run) -> None:
        """Keep a run."""
        self.runs.setdefault(name, []).append(run)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_json(self.path, self.runs)

    def count(self, name: str) -> int:
        """Number of its runs."""
        return len(self.runs.get(name, ()))

    def median(self, name: str, key: str = "seconds") -> float:
        """Median over the runs; raises KeyError if there are none."""
        return statistics.median(run[key] for run in self.runs[name])

    def peak(self, *names: str) -> int | None:
        """Largest memory of several tasks; None where it is not known."""
        peaks = [run["peak"] for n in names for run in self.runs[n]]
        return None if None in peaks else int(max(peaks))

    def paired(self, name: str, less: str, key: str = "seconds") -> float:
        """Median over the rounds of the difference `name` minus `less`."""
        pairs = zip(self.runs[name], self.runs[less], strict=False)
        return statistics.median(a[key] - b[key] for a, b in pairs)

    # --- composition ------------------------------------------------------------------

    def cost(self, config: Config) -> Cost:
        """Seconds by stage, CPU seconds and peak memory of a configuration's frame.

        Raises KeyError when a stage of it could not be timed.
        """
        if config.noise_threshold is not None:
            return self._whole(config)
        wall, cpu = (self._stages(config, key) for key in ("seconds", "cpu"))
        beauty, *guide = config.requests()
        names = [task_name(anchor(beauty.kind, beauty.scale, beauty.denoiser))]
        names += [task_name(anchor(request.kind, more=True)) for request in guide]
        names += [in_process_name(config)] * (config.method not in CYCLES)
        total = sum(wall.values())
        return Cost(wall | {"total": total}, sum(cpu.values()), self.peak(*names))

    def _whole(self, config: Config) -> Cost:
        """The cost of frames that were timed whole: `beauty` holds their denoising.

        They are timed with Blender's default denoiser; another one costs what it costs
        more or less than that.
        """
        name = replace(config, denoiser=DEFAULT_DENOISING).label
        total, other, sync, cpu = (
            self.median(name, k) for k in ("seconds", "other", "sync", "cpu")
        )
        if config.denoiser != DEFAULT_DENOISING:
            total += self._apart(config.denoiser, "seconds")
            cpu += self._apart(config.denoiser, "cpu")
        stages = dict.fromkeys(STAGES, 0.0) | {"sync": sync, "other": other}
        stages["beauty"] = max(total - sync - other, 0.0)
        stages["total"] = sum(stages.values())
        return Cost(stages, cpu, self.peak(name))

    def _apart(self, denoiser: Mode | None, key: str) -> float:
        """Seconds of a denoiser less those of Blender's default, at full size."""
        default = self.denoising(DEFAULT_DENOISING, key=key)
        return self.denoising(denoiser, key=key) - default

    def _stages(self, config: Config, key: str) -> dict[str, float]:
        plain = config.scale == 1
        # without weights no frame of the product was timed
        lone = config.method != "xrds" and not self.count(XRDS_FRAME)
        frame = PLAIN_FRAME if plain or lone else XRDS_FRAME
        stages = dict.fromkeys(STAGES, 0.0)
        stages["sync"] = self.median("sync", key)
        stages["other"] = self.median(frame, "other")
        beauty, *guide = config.requests()
        stages["beauty"] = self._line(beauty, key)
        if config.method == "full_size":
            stages["denoise"] = self.median(in_process_name(config), key)
        elif config.denoiser != OFF:
            stages["denoise"] = self.denoising(config.denoiser, config.scale, key)
        if guide:
            stages["guides"] = self._line(guide[0], key)
        if not plain:
            stages["network"] = self.median(in_process_name(config), key)
        if config.denoises_guides:  # they are kept as they are then
            stages["guides"] += self.median(GUIDE_DENOISER, key)
        return stages

    def line(
        self, kind: str, scale: int = 1, key: str = "seconds"
    ) -> tuple[float, float]:
        """Fixed seconds and seconds per sample of one kind of undenoised render."""
        few, more = (anchor(kind, scale, more=more) for more in (False, True))
        low, high = task_name(few), task_name(more)
        slope = max(self.paired(high, low, key) / (more.samples - few.samples), 1e-6)
        return max(self.median(low, key) - few.samples * slope, 0.0), slope

    def denoising(
        self, denoiser: Mode | None, scale: int = 1, key: str = "seconds"
    ) -> float:
        """Seconds of the denoiser on a frame of 1/scale of the size."""
        kind = "plain" if scale == 1 else "low"
        on = anchor(kind, scale, denoiser)
        off = anchor(self._sampled_as(on), scale)
        return max(self.paired(task_name(on), task_name(off), key), 0.0)

    def _line(self, request: Request, key: str) -> float:
        fixed, slope = self.line(self._sampled_as(request), request.scale, key)
        return fixed + slope * request.samples

    def _sampled_as(self, request: Request) -> str:
        """The kind of render whose samples are the same.

        Where Cycles denoises at full size it takes the guides that our denoiser asks
        for, so both have one line: two would differ by the noise of timing alone.
        """
        denoised = request.kind == "plain" and request.denoiser != OFF
        both = self.count(task_name(anchor("full", more=True)))
        return "full" if denoised and both else request.kind


def task_name(request: Request) -> str:
    """Name of a render in the file of runs."""
    undenoised = request.has_guides or request.denoiser == OFF
    denoiser = "" if undenoised else f" {request.denoiser or 'default'}"
    return f"{request.kind} x{request.scale}, {request.samples} spp{denoiser}"


def in_process_name(config: Config) -> str:
    """Name of what this process makes of the samples, in the file of runs."""
    if config.method == "full_size":
        return f"denoising at full size, {config.denoiser}"
    if config.method != "xrds":
        return f"{config.method} x{config.scale}"
    return f"XRDS {config.preset} x{config.scale}"


class Stopwatch:
    """Times one shot's whole frame, round by round."""

    def __init__(
        self,
        shot: Shot,
        times: StageTimes,
        requests: Sequence[Request],
        tasks: Mapping[str, Task],
        journal: Journal | Strict,
    ) -> None:
        self.shot, self.times, self.journal = shot, times, journal
        self.renders = {task_name(request): request for request in requests}
        self.tasks = tasks

    def left(self, rounds: int) -> list[str]:
        """Names of the runs still to be made, one entry for each run."""
        names = [*self.renders, *self.tasks]
        return [n for n in names for _ in range(rounds - self.times.count(n))]

    def measure(self, rounds: int, done: Callable[[str], object]) -> None:
        """Make the missing runs; `done` gets the name of each."""
        for turn in range(rounds):
            missing = [n for n in self.renders if self._missing(n, turn)]
            if missing:
                self._render(missing[turn:] + missing[:turn], done)
            for name in [n for n in self.tasks if self._missing(n, turn)]:
                with self.journal.attempt(self._job(name)):
                    self.times.add(name, clocked(self.tasks[name]))
                done(name)

    def _missing(self, name: str, turn: int) -> bool:
        gone = self.journal.gives_up(self._job(name))
        return self.times.count(name) <= turn and not gone

    def _job(self, name: str) -> str:
        return f"{self.times.path.stem}: {name}"

    def _render(self, names: list[str], done: Callable[[str], object]) -> None:
        """Make all renders of a round in one session of Cycles, to time sync apart."""
        from xrds_blender import run_job

        def job(passes: Any) -> None:
            synced = False
            for name in names:
                with self.journal.attempt(self._job(name)):
                    run = self._clocked(self.renders[name], passes)
                    if not synced:  # later ones find the scene there
                        sync = run["sync"]
                        self.times.add(
                            "sync", {"seconds": sync, "cpu": sync, "peak": run["peak"]}
                        )
                        synced = True
                    self.times.add(name, run)
                done(name)

        with self.journal.attempt(f"{self.shot.name}: opening the scene"):
            scene = open_scene(self.shot.path, self.shot.window.whole)
            run_job(scene, job)

    def _clocked(self, request: Request, passes: Any) -> Run:
        """Time a render without its sync; reading the pixels back counts."""
        stages: dict[str, float] = {}

        def task() -> None:
            stages.update(request.render(passes)[1])

        run = clocked(task)
        sync = stages.pop("sync")
        return run | {
            "seconds": sum(stages.values()),
            "cpu": max(run["cpu"] - sync, 0.0),  # sync runs on one core
            "sync": sync,
        }


def clocked(task: Task) -> Run:
    """Seconds, CPU seconds and peak memory of a call; a dict it returns wins."""
    known = machine.forget_peak()
    wall, cpu = time.perf_counter(), time.process_time()
    result = task()
    own = result if isinstance(result, dict) else {}
    return {
        "seconds": time.perf_counter() - wall,
        "cpu": time.process_time() - cpu,
        "peak": machine.peak() if known else None,
    } | own
