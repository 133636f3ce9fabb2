"""`xrds bench gallery`: renders what is missing, judges, and writes the report.

Whatever earlier calls with the same cache have measured is in the report too, so that
a long measure can be made in parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..bench import machine, workload
from ..bench.folder_of_report import make_folder
from ..bench.journal import Journal
from ..progress import report_line
from . import report
from .crops import write_crops
from .frames import Measure, Request, Store
from .pictures import ShotFigures
from .rendering import render_apart
from .table import TABLE, Shot, chosen

Report = dict[str, Any]
_SAMPLE_SECONDS = 0.2  # of a frame, one sample per pixel; only ratios count
_JUDGING_SECONDS = 8.0  # of a shot at one number of samples


def bench_gallery(
    names: Sequence[str],
    out: Path,
    measure: Measure,
    *,
    cache: Path | None = None,
    half: str | None = None,
    references_only: bool = False,
    crops: bool = False,
) -> Report:
    """Measure shots of the gallery, by name or all of a half; returns the report.

    What the folder `cache` holds is not rendered again. With `references_only` these
    are rendered and nothing new is judged. `crops` also writes `crops.webp`, of shots
    with neighbours judged and not. Raises UsageError for unknown names.
    """
    shots = chosen(tuple(names), half)
    make_folder(out)
    run = _Run(shots, out, measure, Store(cache or out / "cache"))
    if references_only:
        return run.references()
    made = run.everything()
    if crops:
        whole = [shot for shot in shots if run.has(shot)]
        write_crops(whole, measure, run.store, out / "crops.webp")
    return made


class _Run:
    """One call: what it renders and judges of each shot."""

    def __init__(
        self, shots: Sequence[Shot], out: Path, measure: Measure, store: Store
    ) -> None:
        self.shots, self.out, self.measure, self.store = shots, out, measure, store
        path = store.directory / "journal-gallery.json"
        self.journal = Journal(path, report_line)

    def references(self) -> Report:
        """Render references: a part of all shots' middle frames first."""
        steps = [
            (shot, [request])
            for shot in self.shots
            for number in self.measure.judged(shot)
            for parts in self.measure.references(shot, number)
            for request in parts
        ]
        rank = self.measure.rank
        steps.sort(key=lambda step: rank(step[0], step[1][0]))
        return self._run(_joined(steps), judging=0.0)

    def everything(self) -> Report:
        """Render and judge shot by shot, with a report after each."""
        steps = [(shot, self.measure.all_of(shot)) for shot in self.shots]
        return self._run(steps, judging=_JUDGING_SECONDS)

    def has(self, shot: Shot) -> bool:
        """Whether all frames of a shot are there; some may have failed."""
        return all(map(self.store.has, self.measure.all_of(shot)))

    def _run(
        self, steps: Sequence[tuple[Shot, list[Request]]], judging: float
    ) -> Report:
        seconds = sum(
            sum(_seconds(r) for r in requests if not self.store.has(r))
            + judging * len(shot.counts(self.measure.samples))
            for shot, requests in steps
        )
        self.meter = workload.Meter(seconds)
        self.journal.progress = self.meter.write
        try:
            for shot, requests in steps:
                self._render(shot, requests)
                if judging:
                    self._judge(shot)
        finally:
            self.meter.close()
        return self._written()

    def _render(self, shot: Shot, requests: Sequence[Request]) -> None:
        left = [r for r in requests if not self.store.has(r)]
        if not left:
            return
        # named by what is next, so that to interrupt it three times is no failure
        task = f"{shot.name}: {left[0].file_name}"
        if self.journal.gives_up(task):
            return

        def done(request: Request) -> None:
            what = f"{shot.name}: {request.kind}, frame {request.number}"
            self.meter.done(_seconds(request), what)

        with self.journal.attempt(task):
            render_apart(left, self.store, done)

    def _judge(self, shot: Shot) -> None:
        with self.journal.attempt(f"{shot.name}: figures"):
            ShotFigures(shot, self.measure, self.store).measure_all()
        counts = len(shot.counts(self.measure.samples))
        self.meter.done(_JUDGING_SECONDS * counts, f"{shot.name}: judged")
        self._written()

    def _written(self) -> Report:
        found = (ShotFigures(shot, self.measure, self.store) for shot in TABLE)
        results = {
            "settings": {
                "samples": list(self.measure.samples),
                "reference_samples": self.measure.reference_samples,
                "size": list(self.measure.size),
            },
            "machine": machine.describe(),
            "shots": [point for figures in found for point in figures.points()],
            "failures": self.journal.failures,
        }
        report.write(self.out, results)
        return results


def _seconds(request: Request) -> float:
    return _SAMPLE_SECONDS * (request.samples + 2.0)


def _joined(
    steps: Sequence[tuple[Shot, list[Request]]],
) -> list[tuple[Shot, list[Request]]]:
    """Neighbouring steps of one shot made one: a process for each is started."""
    joined: list[tuple[Shot, list[Request]]] = []
    for shot, requests in steps:
        if joined and joined[-1][0] is shot:
            joined[-1][1].extend(requests)
        else:
            joined.append((shot, list(requests)))
    return joined
