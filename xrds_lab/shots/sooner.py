"""`xrds bench same-picture`: in how many seconds the picture of a file's settings.

Each scene is made a shot, or moves as its file says. Cycles + OIDN renders frames of it
with all samples, XRDS the whole shot with as few as it chooses, and nine frames with
all. Seconds are wall clock, which needs a quiet machine, and the processor's own, which
suffer less from others at work. The three take turns within a case, never at once;
Cycles is timed before and after the shot with few samples.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.command import console
from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.errors import UsageError
from xrds_core.files import read_json, write_json

from .. import metrics
from ..bench import machine
from ..bench.folder_of_report import make_folder
from ..bench.inputs import Folder, open_scene, sample_adaptively
from ..bench.journal import Journal
from ..bench.windows import find_shots
from ..cards.cycles import CPU
from ..csv_table import write_table
from ..gallery.judge import compare
from ..progress import report_line
from .frames import MIDDLE, REACH, ShotFrames
from .methods import CYCLES, SAME_PICTURE, SAME_SAMPLES
from .motions import animate
from .truth import Truth, requests_of_truth

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from xrds_core.arrays import Array

    from ..bench.windows import Shot

    Row = dict[str, Any]

SAMPLES = (16, 64, 256)
FRAMES = 21
"""Frames of a shot: no neighbour of the middle one is measured in, with more samples.
"""
MOST_SAMPLES = 4096
"""Of a pixel under a noise threshold, as in a new file."""
_IN_TURN = ((CYCLES, SAME_PICTURE), (SAME_SAMPLES,))  # what takes longest comes last
_TIMED = 3  # frames of Cycles, around the middle one
REFERENCE_SAMPLES = 128


@dataclass(frozen=True)
class Case:
    """What a file asks for: samples, or with a noise threshold at most so many.

    `frames` are those of the shot.
    """

    motion: str
    samples: int
    noise_threshold: float | None = None
    frames: int = FRAMES

    @property
    def label(self) -> str:
        """Name in files and tables."""
        adaptive = "" if self.noise_threshold is None else f"-{self.noise_threshold:g}"
        length = "" if self.frames == FRAMES else f"-of{self.frames}"
        return f"{self.motion}-{self.samples}{adaptive}{length}"


@dataclass(frozen=True)
class Made:
    """A method's middle frame (H, W, 3) and the next, seen at `stops`, and their price.

    `seconds` are of a frame by the clock, `processor` of all cores; `late` the latter
    of a frame of the last third of the shot, None of one alone.
    `shares` are of the file's samples, one for each frame. `stages` are the seconds by
    the clock of each part of a late frame, which run beside those of other frames.
    """

    radiance: Array
    following: Array
    seconds: float
    processor: float
    stops: float
    shares: tuple[float, ...] = ()
    late: float | None = None
    stages: dict[str, float] = field(default_factory=dict)

    def within(self, place: tuple[slice, slice]) -> Made:
        """The same of rows and columns of the pictures."""
        pictures = self.radiance[place], self.following[place]
        return replace(self, radiance=pictures[0], following=pictures[1])


def bench_same_picture(
    scenes: Sequence[Path],
    out: Path,
    cases: Sequence[Case],
    *,
    windows: Path | None = None,
    references: Path | None = None,
    resolution: tuple[int, int] | None = None,
    around: tuple[int, int] | None = None,
    cache: Path | None = None,
    reference_samples: int = REFERENCE_SAMPLES,
    device: str = CPU,
) -> dict[str, Any]:
    """Measure what is missing, write the report into `out` and return it.

    Errors are of the shot's middle frame, which is the file's own view, against two
    renders of `reference_samples` each, without their noise; with `references` against
    these, and flicker alone by such renders. `around` is the width and height of what
    is rendered around the windows. Cycles renders on a `device` as in `Shot`. Raises
    UsageError for missing files, what does not fit, and too short a shot.
    """
    fewest = min(case.frames for case in cases)
    if fewest < 2 * REACH + 1:
        raise UsageError(f"{fewest} frames: give {2 * REACH + 1} or more")
    make_folder(out)
    folder = Folder(cache or out / "cache")
    journal = Journal(folder.directory / "journal-same-picture.json", report_line)
    with console.stdout_to(folder.directory / "blender.log"):
        shots = find_shots(scenes, windows, references, resolution, device)
        parts = [
            _Scene(replace(shot, size=around), folder, reference_samples)
            for shot in shots
        ]
        for methods in _IN_TURN:
            for case, part in product(cases, parts):
                with journal.attempt(f"{part.shot.name}: {case.label}"):
                    part.measure(case, methods, journal)
                _write(parts, journal, out)
        return _write(parts, journal, out)


class _Scene:
    """One scene: its rows, kept in a file."""

    def __init__(self, shot: Shot, folder: Folder, reference_samples: int) -> None:
        self.shot, self.folder = shot, folder
        self._frames = ShotFrames(replace(shot, size=None), folder)
        self._reference_samples = reference_samples
        self._place = shot.window.within(shot.rendered)
        name = f"{shot.identity}-{shot.rendered.label}-same-picture.json"
        self._path = folder.directory / name
        self.rows: dict[str, Row] = (
            read_json(self._path) if self._path.is_file() else {}
        )

    def measure(self, case: Case, methods: Sequence[str], journal: Journal) -> None:
        """Render and judge what is missing of one case."""
        work = {
            CYCLES: lambda: _cycles(self.shot, case),
            SAME_PICTURE: lambda: _same_picture(self.shot, case),
            SAME_SAMPLES: lambda: _same_samples(self.shot, case),
        }
        missing = [x for x in methods if f"{case.label}-{x}" not in self.rows]
        if not missing:
            return
        wanted = requests_of_truth(case.motion, self._reference_samples)
        self._frames.render(wanted, journal, lambda _: None)
        truth = Truth.of(self._frames, case.motion, self._reference_samples)
        for method in missing:
            report_line(f"{self.shot.name}: {case.label}, {method}")
            made = work[method]().within(self._place)
            picture = {"radiance": made.radiance, "following": made.following}
            self.folder.write(self._picture(case, method), picture, {})
            if method == SAME_PICTURE:
                self._time_again(case)
            self.rows[f"{case.label}-{method}"] = self._judged(
                case, method, made, truth
            )
            write_json(self._path, self.rows)

    def _time_again(self, case: Case) -> None:
        """Make Cycles' seconds the mean of those before and after a shot's."""
        row = self.rows[f"{case.label}-{CYCLES}"]
        seconds, processor = _cycles_again(self.shot, case)
        row["seconds"] = round((row["seconds"] + seconds) / 2, 3)
        row["processor_seconds"] = round((row["processor_seconds"] + processor) / 2, 3)

    def _judged(self, case: Case, method: str, made: Made, truth: Truth) -> Row:
        single = self.folder.read(self._picture(case, CYCLES))
        assert single is not None  # Cycles comes first
        pictures = made.radiance, single["radiance"], *truth.pair
        shown, alone, *true = (metrics.to_srgb(x, made.stops) for x in pictures)
        verdict = compare(shown, alone, true)
        error = metrics.flip(made.radiance, truth.clean, made.stops)
        flicker = truth.flicker((made.radiance, made.following), made.stops)
        own = {"seconds": made.seconds, "processor_seconds": made.processor}
        cycles = self.rows.get(f"{case.label}-{CYCLES}", own)
        ratios = {name: round(x / cycles[name], 3) for name, x in own.items()}
        return {
            "scene": self.shot.name,
            "motion": case.motion,
            "samples": case.samples,
            "noise_threshold": case.noise_threshold,
            "frames": case.frames,
            "size": f"{self.shot.rendered.width}x{self.shot.rendered.height}",
            "method": method,
            "seconds": round(made.seconds, 3),
            "ratio": ratios["seconds"],
            "late_ratio": made.late
            and round(made.late / cycles["processor_seconds"], 3),
            "processor_seconds": round(made.processor, 3),
            "processor_ratio": ratios["processor_seconds"],
            "mean_share": round(float(np.mean(made.shares or [1.0])), 3),
            "late_share": round(_late(made.shares), 3) if made.shares else None,
            "shares": [round(x, 3) for x in made.shares],
            "stages": {name: round(x, 3) for name, x in made.stages.items()},
            "psnr": round(verdict.psnr, 3),
            "gain": round(verdict.gain, 3),
            "flip": round(error, 5),
            "flicker": round(flicker, 5),
            "worst_block": round(verdict.worst, 2),
            "share_of_blocks": round(verdict.share, 4),
        }

    def _picture(self, case: Case, method: str) -> str:
        window = self.shot.rendered.label
        return f"{self.shot.identity}-{window}-{case.label}-{method}.npz"


def _opened(shot: Shot, case: Case, reach: int) -> Any:
    scene = open_scene(shot.path, shot.rendered, shot.device)
    scene.cycles.samples = case.samples
    if case.noise_threshold is not None:
        sample_adaptively(scene, case.samples, case.noise_threshold)
    animate(scene, shot.window, case.motion, MIDDLE, reach)
    scene.render.use_persistent_data = True  # for all three: one sync of the scene
    return scene


def _cycles(shot: Shot, case: Case) -> Made:
    """Cycles and its denoiser, as a new file has it."""
    scene = _opened(shot, case, case.frames // 2)
    middle = scene.frame_current
    numbers = range(middle - _TIMED // 2, middle + _TIMED // 2 + 1)
    shown, *taken = _rendered(scene, numbers)
    seconds, processor = (statistics.median(x) for x in taken)
    return Made(shown[middle], shown[middle + 1], seconds, processor, _stops(scene))


def _cycles_again(shot: Shot, case: Case) -> tuple[float, float]:
    """Seconds of its middle frame, by the clock and of all cores, without a sync."""
    scene = _opened(shot, case, case.frames // 2)
    middle = scene.frame_current
    _, seconds, processor = _rendered(scene, (middle - 1, middle))
    return seconds[-1], processor[-1]


def _rendered(
    scene: Any, numbers: Sequence[int]
) -> tuple[dict[int, Array], list[float], list[float]]:
    """Frames by Cycles, seconds of each by the clock, and of all cores."""
    from xrds_blender import render

    seconds, processor, shown = [], [], {}
    for number in numbers:
        scene.frame_set(number)
        started, busy = time.perf_counter(), time.process_time()
        picture = render(scene, plain=True, denoiser=DEFAULT_DENOISING)
        seconds.append(time.perf_counter() - started)
        processor.append(time.process_time() - busy)
        shown[number] = np.asarray(picture.radiance, np.float32)
    return shown, seconds, processor


def _same_picture(shot: Shot, case: Case) -> Made:
    """The whole shot; its first frames' measuring is in the seconds."""
    return _shot(shot, case, case.frames, same_picture=True)


def _same_samples(shot: Shot, case: Case) -> Made:
    """The file's samples: a better picture."""
    return _shot(shot, case, 2 * REACH + 1, same_picture=False)


def _shot(shot: Shot, case: Case, frames: int, **choices: bool) -> Made:
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.shot import render_shot

    reach = frames // 2
    scene = _opened(shot, case, reach)
    middle = scene.frame_current
    numbers = range(middle - reach, middle + reach + 1)
    job = render_request(scale=1, temporal_radius=REACH, **choices)
    shown, shares, spent, stages = {}, [], [], []
    started, busy = time.perf_counter(), time.process_time()
    for number, picture in render_shot(scene, job, numbers):
        assert picture.settings is not None
        shares.append(float(picture.settings.share))
        spent.append(time.process_time())
        stages.append(picture.seconds)
        if number in (middle, middle + 1):
            shown[number] = np.asarray(picture.radiance, np.float32)
    seconds = (time.perf_counter() - started) / len(numbers)
    processor = (time.process_time() - busy) / len(numbers)
    pictures = shown[middle], shown[middle + 1]
    stops = _stops(scene)
    # a frame is finished beside the samples of a later one: what is spent between two
    # is known, and of the last ones none is sampled
    between = np.diff(spent)[: len(spent) - REACH - 2]
    late = statistics.median(between[-len(spent) // 3 :])
    return Made(
        *pictures,
        seconds,
        processor,
        stops,
        tuple(shares),
        float(late),
        {name: _late([x.get(name, 0.0) for x in stages]) for name in stages[-1]},
    )


def _late(values: Sequence[float]) -> float:
    """The median of the last third of a shot's frames."""
    return statistics.median(values[-len(values) // 3 :])


def _stops(scene: Any) -> float:
    return float(scene.view_settings.exposure)


_COLUMNS = {
    "scene": "scene",
    "samples": "samples",
    "noise_threshold": "threshold",
    "frames": "frames",
    "size": "size",
    "method": "method",
    "seconds": "s a frame",
    "ratio": "of Cycles'",
    "processor_ratio": "of its processor seconds",
    "late_ratio": "of these late in the shot",
    "mean_share": "share of samples",
    "late_share": "late",
    "psnr": "PSNR",
    "gain": "gain",
    "flip": "FLIP",
    "flicker": "flicker",
    "worst_block": "worst block",
    "share_of_blocks": "blocks below -1 dB",
}


def _write(parts: Sequence[_Scene], journal: Journal, out: Path) -> dict[str, Any]:
    rows = [row for part in parts for row in part.rows.values()]
    results = {
        "machine": machine.describe(parts[0].shot.device.lower()),
        "shots": rows,
        "failures": journal.failures,
    }
    write_json(out / "results.json", results)
    write_table(out / "results.csv", rows)
    lines = [
        "# The same picture, sooner",
        "Written by `xrds bench same-picture`. *Gain* is in dB over Cycles + OIDN of "
        "all samples, blocks of 32x32 pixels against those of that picture.",
        "\n".join(_table(rows)),
    ]
    (out / "report.md").write_text("\n\n".join(lines) + "\n", "utf-8")
    return results


def _table(rows: Sequence[Row]) -> list[str]:
    head = [f"| {' | '.join(_COLUMNS.values())} |", "|---" * len(_COLUMNS) + "|"]
    cells = ([str(row[name]) for name in _COLUMNS] for row in rows)
    return head + [f"| {' | '.join(each)} |" for each in cells]
