"""`xrds bench --gallery`: renders what is missing, judges, and writes the report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from xrds_core.atomic import read_json, write_json
from xrds_core.errors import UsageError

from ..bench import machine, workload
from ..bench.journal import Journal
from ..progress import report_line
from . import report
from .frames import Measure, Request, Store
from .judge import judge
from .rendering import render_apart
from .table import HALVES, TABLE, Shot, chosen

Report = dict[str, Any]


def bench_gallery(
    names: Sequence[str],
    out: Path,
    measure: Measure,
    *,
    cache: Path | None = None,
    half: str | None = None,
    references_only: bool = False,
) -> Report:
    """Measure shots of the gallery, by name or all of a half; returns the report.

    What the folder `cache` holds is not rendered again. With `references_only` these
    are rendered and nothing is judged. Raises UsageError for unknown names.
    """
    if half not in (None, *HALVES):
        raise UsageError(f"half {half!r} is not one of {', '.join(HALVES)}")
    shots = chosen(tuple(names), half)
    out.mkdir(parents=True, exist_ok=True)
    return _Run(shots, out, measure, Store(cache or out / "cache")).run(
        references_only
    )


class _Run:
    def __init__(
        self, shots: Sequence[Shot], out: Path, measure: Measure, store: Store
    ) -> None:
        self.shots, self.out, self.measure, self.store = shots, out, measure, store
        path = store.directory / "journal-gallery.json"
        self.journal = Journal(path, report_line)
        self.points: list[dict[str, Any]] = []

    def run(self, references_only: bool) -> Report:
        steps = self._references() if references_only else self._everything()
        missing = [r for _, part in steps for r in part if not self.store.has(r)]
        self.meter = workload.Meter(sum(r.cost for r in missing))
        self.journal.progress = self.meter.write
        try:
            for shot, requests in steps:
                self._render(shot, requests)
                if not references_only:
                    self._judge(shot)
        finally:
            self.meter.close()
        return self._written()

    def _references(self) -> list[tuple[Shot, list[Request]]]:
        """The middle frames' references of all shots first: they count most."""
        return [
            (shot, self.measure.references(shot, shot.judged[which]))
            for which in (0, 1)
            for shot in self.shots
        ]

    def _everything(self) -> list[tuple[Shot, list[Request]]]:
        return [(shot, self.measure.all_of(shot)) for shot in self.shots]

    def _render(self, shot: Shot, requests: Sequence[Request]) -> None:
        left = [r for r in requests if not self.store.has(r)]
        # named by where it begins, so that three interruptions are no failure
        if not left or self.journal.gives_up(task := f"{shot.name}: {left[0].file_name}"):
            return

        def done(request: Request) -> None:
            self.meter.done(
                request.cost,
                f"{shot.name}: {request.kind} frame {request.number}",
            )

        with self.journal.attempt(task):
            render_apart(left, self.store, done)

    def _judge(self, shot: Shot) -> None:
        with self.journal.attempt(f"{shot.name}: figures"):
            self.points += judge(shot, self.measure, self.store)
            self._written()

    def _written(self) -> Report:
        results = {
            "settings": {
                "samples": list(self.measure.samples),
                "reference_samples": self.measure.reference_samples,
                "size": list(self.measure.size),
            },
            "machine": machine.describe(),
            "shots": _merged(self.out / report.RESULTS, self.points),
            "failures": self.journal.failures,
        }
        report.write(self.out, results)
        return results
