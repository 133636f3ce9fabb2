"""`xrds bench device-report`: every stage on the card of this machine and beside it.

Three shots of the gallery, which the project makes itself. First each is panned over,
by Cycles and its denoiser, with the same samples and for the same picture; then come
the stages. Cases are kept as they are done, so a run that was stopped, or ran out of
minutes, goes on where it was.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_core.files import read_json, write_json

from ..bench import machine
from ..bench.folder_of_report import make_folder
from ..bench.journal import Journal
from ..csv_table import write_table
from ..gallery.table import SHOTS as ALL_SHOTS
from ..progress import report_line
from ..shots import sooner
from .cycles import find_card
from .measure import Case, measure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    Row = dict[str, Any]
    Size = tuple[int, int]

SHOTS = ("hand_held", "figure", "plane_mirror")
SIZES = ((1920, 1080), (3840, 2160))
SAMPLES = (16, 4, 1, 64)
RADII = (1, 2, 4)
MINUTES = 10.0
PICTURE_SAMPLES = 64  # of a file whose picture is made in fewer


def bench_devices(
    out: Path,
    *,
    shots: Sequence[str] = SHOTS,
    sizes: Sequence[Size] = SIZES,
    samples: Sequence[int] = SAMPLES,
    picture_samples: int = PICTURE_SAMPLES,
    radii: Sequence[int] = RADII,
    minutes: float = MINUTES,
    rounds: int = 3,
    reference_samples: int = 512,
) -> dict[str, Any]:
    """Measure what is missing within `minutes`, write the report and return it.

    `shots` are of the gallery; at further sizes the first of them is measured.
    Times are of a whole frame, medians of `rounds`; `cpu` and `card` take turns. The
    first of `samples` is timed by stage, the others give their pictures alone; those of
    *Same Picture* are `picture_samples`. Without a card `card` is the processor, too,
    which always accumulates.
    """
    make_folder(out)
    kept = out / "cache"
    kept.mkdir(exist_ok=True)
    journal = Journal(kept / "journal.json", report_line)
    ends = time.monotonic() + 60.0 * minutes
    with console.stdout_to(kept / "blender.log"):
        cycles = find_card()
        about = {**machine.describe(), "cycles_device": cycles}
        report_line(f"Cycles on {cycles}")
        pan = _Pan(sizes[0], picture_samples, reference_samples, cycles, out)
        for name in shots:
            if time.monotonic() > ends:
                journal.failures[name] = "no minutes were left: run it again"
                continue
            with journal.attempt(name):
                journal.failures.update(pan.measure(name)["failures"])
        known: list[Row] = []
        for case in _cases(shots, sizes, samples, radii, cycles):
            one = replace(case, rounds=rounds, reference_samples=reference_samples)
            path = kept / f"{one.label}.json"
            if not path.is_file():
                if time.monotonic() > ends:
                    journal.failures[one.label] = "no minutes were left: run it again"
                    continue
                with journal.attempt(one.label):
                    rows = []
                    for row in measure(one, kept):
                        rows.append(row)
                        report_line(_line(one, row))
                        _write([*known, *rows], about, journal, out)
                    write_json(path, rows)
            if path.is_file():
                known += read_json(path)
            _write(known, about, journal, out)
    return _write(known, about, journal, out)


@dataclass(frozen=True)
class _Pan:
    """Shots of the gallery that a camera pans over, as `xrds bench same-picture`."""

    size: Size
    samples: int
    reference_samples: int
    device: str
    out: Path

    def measure(self, name: str) -> dict[str, Any]:
        """Measure what is missing of a shot, into a folder of its own."""
        import bpy

        folder = self.out / f"same-picture-{name}"
        folder.mkdir(exist_ok=True)
        blend = folder / f"{name}.blend"
        if not blend.is_file():
            ALL_SHOTS[name].build(folder, self.size)
            bpy.ops.wm.save_as_mainfile(filepath=str(blend.resolve()))
        return sooner.bench_same_picture(
            [blend],
            folder,
            [sooner.Case("pan", self.samples)],
            resolution=self.size,
            # four renders of each shot, where the stages have two
            reference_samples=max(self.reference_samples // 2, 1),
            device=self.device,
        )


def _line(case: Case, row: Row) -> str:
    radius = f", radius {row['radius']}" if row["radius"] else ""
    return f"{case.label}: {row['method']}{radius}, {row['psnr']:.2f} dB"


def _cases(
    shots: Sequence[str],
    sizes: Sequence[Size],
    samples: Sequence[int],
    radii: Sequence[int],
    cycles: str,
) -> list[Case]:
    """Every shot at the first size; the first one at larger sizes, which take long."""
    return [
        Case(
            shot,
            size,
            count,
            tuple(radii),
            is_timed=count == samples[0],
            cycles=cycles,
        )
        for size in sizes
        for shot in (shots if size == sizes[0] else shots[:1])
        for count in samples
    ]


def _write(
    rows: Sequence[Row], about: dict[str, Any], journal: Journal, out: Path
) -> dict[str, Any]:
    pans = sorted(out.glob("same-picture-*/results.json"))
    results = {
        "machine": about,
        "pans": [row for path in pans for row in read_json(path)["shots"]],
        "shots": list(rows),
        "failures": journal.failures,
    }
    write_json(out / "results.json", results)
    write_table(out / "results.csv", [_flat(row) for row in rows])
    with suppress(ImportError):  # a bare machine has no matplotlib: draw it elsewhere
        from .plot import draw

        draw(results, out / "error-seconds.svg")
    return results


def _flat(row: Row) -> Row:
    width, height = row["size"]
    return {**row, "size": f"{width}x{height}"}
