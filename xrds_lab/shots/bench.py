"""`xrds bench shots`: the standard measure for shots, on this machine.

One call measures, resumes and reports. Whatever earlier calls with the same cache have
measured is in the report too, so that a long measure can be made in parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_core.errors import UsageError
from xrds_core.files import write_json

from ..bench import machine, workload
from ..bench.folder_of_report import make_folder
from ..bench.inputs import Folder
from ..bench.journal import Journal
from ..bench.windows import find_shots
from ..csv_table import write_table
from ..progress import report_line
from . import (
    answer,
    equal_seconds,
    estimate,
    film,
    page,
    paired,
    plot,
    report,
    verdicts,
)
from .figures import Clip, SceneFigures
from .frames import REACH, ShotFrames
from .motions import MADE
from .seconds import SceneSeconds
from .seeds import over_seeds

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..bench.windows import Shot
    from .frames import FrameRequest

    Report = dict[str, Any]

SAMPLES = (2,)
RADII = (0, 1, 2, 4)
REFERENCE_SAMPLES = 128
ROUNDS = 3


@dataclass(frozen=True)
class Measure:
    """What is measured of each scene."""

    motions: tuple[str, ...] = tuple(MADE)
    samples: tuple[int, ...] = SAMPLES
    radii: tuple[int, ...] = RADII
    seeds: int = 1
    seconds: bool = False
    seconds_at: tuple[int, int] | None = None  # width, height; the shots' own
    seconds_samples: tuple[int, ...] = ()  # that are timed; all
    films: bool = False
    rounds: int = ROUNDS

    def __post_init__(self) -> None:
        given = {"samples": self.samples, "radii": self.radii, "seeds": (self.seeds,)}
        for name, values in given.items():
            least = 0 if name == "radii" else 1
            if min(values) < least:
                raise UsageError(f"{name} {getattr(self, name)}: give {least} or more")


def bench_shots(
    scenes: Sequence[Path],
    out: Path,
    measure: Measure,
    *,
    windows: Path | None = None,
    references: Path | None = None,
    resolution: tuple[int, int] | None = None,
    cache: Path | None = None,
    reference_samples: int = REFERENCE_SAMPLES,
) -> Report:
    """Measure shots of scene files and write the report into `out`; returns it.

    `windows` (a file) and `references` (a folder of NAME.exr) are as for `bench`;
    without them errors are of the whole frame, against two renders of
    `reference_samples` each, without their noise. `resolution` replaces the files' own.
    Raises UsageError for missing files, before anything is rendered.
    """
    make_folder(out)
    folder = Folder(cache or out / "cache")
    journal = Journal(folder.directory / "journal-shots.json", report_line)
    with console.stdout_to(folder.directory / "blender.log"):
        shots = find_shots(scenes, windows, references, resolution)
        parts = [
            _Scene(shot, folder, journal, reference_samples, measure) for shot in shots
        ]
        return _measured(parts, measure, journal, out)


@dataclass
class _Scene:
    """One scene of the report."""

    shot: Shot
    folder: Folder
    journal: Journal
    reference_samples: int
    measure: Measure

    def __post_init__(self) -> None:
        self.frames = ShotFrames(self.shot, self.folder)
        self.figures = SceneFigures(self.frames, self.reference_samples)
        self.seconds = SceneSeconds(
            self.shot, self.folder.directory, self.measure.seconds_at
        )

    def wanted(self, motion: str, samples: int) -> list[FrameRequest]:
        """The frames of one shot that are still to be rendered."""
        needed = [
            request
            for seed in range(self.measure.seeds)
            for request in self.figures.requests(
                motion, samples, self.measure.radii, seed
            )
        ]
        return [r for r in needed if not self.frames.has(r)]

    def cost(self, cases: Sequence[tuple[str, int]]) -> float:
        """What the missing frames of all shots take, in the unit of `cost`."""
        missing = {
            r.file_name(self.shot): cost(r)
            for case in cases
            for r in self.wanted(*case)
        }
        return sum(missing.values())

    def shoot(self, motion: str, samples: int, meter: workload.Meter) -> None:
        """Render and measure one shot, with every seed."""
        what = f"{self.shot.name}: {motion}, {samples} spp"

        def done(request: FrameRequest) -> None:
            meter.done(cost(request), f"{what}, frame {request.number}")

        self.frames.render(self.wanted(motion, samples), self.journal, done)
        with self.journal.attempt(f"{what}, figures"):
            for seed in range(self.measure.seeds):
                self.figures.measure(motion, samples, self.measure.radii, seed)

    def time(self) -> None:
        """Time whole frames at every number of samples."""
        for samples in self.measure.seconds_samples or self.measure.samples:
            with self.journal.attempt(f"{self.shot.name}: seconds, {samples} spp"):
                self.seconds.measure(samples, self.measure.radii, self.measure.rounds)

    def points(self) -> list[dict[str, Any]]:
        """All figures, each with its seconds per frame where they are known."""
        points = self.figures.points()
        for point in points:
            point["seconds_per_frame"] = self.seconds.per_frame(
                point["method"], point["samples"], point["radius"]
            )
        return points


def cost(request: FrameRequest) -> float:
    """What a frame takes beside others: samples, and what every render takes."""
    return request.samples + 3.0


def _measured(
    parts: Sequence[_Scene], measure: Measure, journal: Journal, out: Path
) -> Report:
    """Shot by shot, each of all scenes, with a report of what is done after each."""
    cases = [(m, n) for m in measure.motions for n in measure.samples]
    left = {part.shot: part.cost(cases) for part in parts}
    left = {shot: units for shot, units in left.items() if units}
    if left:
        report_line(estimate.sentence(left))
    meter = workload.Meter(sum(part.cost(cases) for part in parts))
    journal.progress = meter.write
    try:
        for case in cases:
            for part in parts:
                part.shoot(*case, meter)
            _written(parts, journal, out)
        for part in parts:
            if measure.seconds:
                part.time()
        results = _written(parts, journal, out)
        if measure.films:
            _films(parts, over_seeds(results["shots"]), out)
    finally:
        meter.close()
    return results


def _films(parts: Sequence[_Scene], points: Sequence[Any], out: Path) -> None:
    """Films of the best and the worst shot at each number of samples asked for."""
    by_name = {part.shot.name: part for part in parts}
    for samples in parts[0].measure.samples:
        for rank, (scene, motion) in film.chosen(points, samples).items():
            clip = Clip(by_name[scene].frames, motion, samples, REACH)
            film.write(out / f"{rank}-{scene}-{motion}-{samples}spp.webp", clip)


def compared(points: Sequence[dict[str, Any]]) -> Report:
    """What `results.json` says of points beside Cycles + OIDN's."""
    differences = paired.differences(points)
    return {
        "differences": differences,
        "verdicts": verdicts.verdicts(differences),
        "equal_seconds": equal_seconds.entries(over_seeds(points)),
    }


def _written(parts: Sequence[_Scene], journal: Journal, out: Path) -> Report:
    points = [point for part in parts for point in part.points()]
    means = over_seeds(points)
    results = {
        "settings": {
            "middle": "the file's own view",
            "reference_samples": parts[0].reference_samples,
            "radius": REACH,
            "seconds_resolution": parts[0].measure.seconds_at,
        },
        "machine": machine.describe(),
        "shots": points,
        **compared(points),
        "failures": journal.failures,
    }
    write_json(out / "results.json", results)
    write_table(out / "results.csv", results["shots"])
    for motion in parts[0].measure.motions:
        svg = plot.error_plot(means, motion, parts[0].measure.seconds_at)
        if svg is not None:
            (out / f"error-{motion}.svg").write_bytes(svg)
    crops = {k: p for part in parts for k, p in part.figures.kept_crops().items()}
    page.write(out / "report.html", results, crops)
    report.write(out / "report.md", results)
    answer.write(out, means, results["equal_seconds"], crops)
    return results
