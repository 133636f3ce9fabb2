"""`xrds bench stills`: error against run time of every method, on this machine.

One call measures, resumes and reports: whatever an earlier call with the same output
folder has measured is kept, and the report is written anew after every scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_blender.planning.settings import Network
from xrds_core.files import write_json
from xrds_core.progress import duration

from ..csv_table import write_table
from ..progress import report_line
from . import analysis, machine, report, workload
from .folder_of_report import make_folder
from .inputs import Folder
from .journal import Journal
from .measure import SceneBench, Settings
from .pictures import Networks
from .stages import ROUNDS
from .sweep import NOISE_THRESHOLDS, Sweep
from .windows import find_shots

if TYPE_CHECKING:
    Report = dict[str, Any]

BUDGETS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
REFERENCE_SAMPLES = 128


def bench(
    scenes: Sequence[Path],
    out: Path,
    *,
    budgets: Sequence[float] = BUDGETS,
    resolution: tuple[int, int] | None = None,
    reference_samples: int = REFERENCE_SAMPLES,
    windows: Path | None = None,
    references: Path | None = None,
    cache: Path | None = None,
    presets: Sequence[str] | None = None,
    rounds: int = ROUNDS,
    timing: bool = True,
    picker: bool = True,
    noise_thresholds: Sequence[float] = NOISE_THRESHOLDS,
    coarse: bool = False,
    model: Path | None = None,
    weights: Path | None = None,
    device: str = "auto",
    sweep: Sweep | None = None,
) -> Report:
    """Measure scene files and write the report into `out`; returns results.json.

    `budgets` are multiples of a scene's own seconds for one sample and Blender's
    default denoiser. `windows` (a file) and `references` (a folder of NAME.exr)
    are as for `evaluate`; without them errors are of the whole frame, against the
    mean of two renders of `reference_samples` each. `resolution` replaces the
    files' own. `presets` None takes all whose weights are there. Without `timing`
    only errors are measured. `noise_thresholds` are of Cycles' adaptive sampling.
    `coarse` leaves out what full size beats on every scene. `model` is where to write
    the picker's model. `sweep` replaces what `presets`, `noise_thresholds` and `coarse`
    ask for. Raises UsageError for missing files and unknown names, before anything is
    rendered.
    """
    make_folder(out)
    networks = Networks(weights, device)
    folder = Folder(cache or out / "cache")
    journal = Journal(folder.directory / "journal.json", report_line)
    chosen = Settings(
        sweep or _sweep(of_presets(networks, presets), noise_thresholds, coarse),
        folder,
        networks,
        journal,
        tuple(budgets),
        rounds,
        reference_samples,
        timing,
        picker,
    )
    with console.stdout_to(folder.directory / "blender.log"):
        shots = find_shots(scenes, windows, references, resolution)
        parts = [SceneBench(shot, chosen) for shot in shots]
        _report_missing(networks, presets)
        results = _measured(parts, chosen, out)
    if model is not None:
        write_json(model, analysis.fitted(parts, results["points"]).to_json())
    return results


def _measured(
    parts: Sequence[SceneBench],
    chosen: Settings,
    out: Path,
) -> Report:
    """Scene by scene, with a report of those that are done after each."""
    meter = workload.Meter(_estimate(parts))
    chosen.journal.progress = meter.write
    results: Report = {}
    try:
        for number, part in enumerate(parts, 1):
            part.measure(meter)
            results = _results(parts[:number], chosen)
            write(out, results)
            report.write(out, results, parts[:number])
    finally:
        meter.close()
    return results


def _sweep(
    networks: tuple[Network, ...], noise_thresholds: Sequence[float], coarse: bool
) -> Sweep:
    whole = Sweep(networks, noise_thresholds=tuple(noise_thresholds))
    return whole.coarser() if coarse else whole


def of_presets(
    networks: Networks, presets: Sequence[str] | None
) -> tuple[Network, ...]:
    """Those of some presets; of all where None."""
    return tuple(n for n in networks.records if presets is None or n.preset in presets)


def _report_missing(networks: Networks, presets: Sequence[str] | None) -> None:
    lacking = [
        f"{preset} x{scale}"
        for preset, scale in _absent(networks)
        if presets is None or preset in presets
    ]
    if lacking:
        report_line(f"no weights, left out: {', '.join(lacking)}")


def _absent(networks: Networks) -> list[Network]:
    """Networks of the product without weights."""
    wanted = [
        Network(preset, scale) for preset in ("fast", "balanced") for scale in (2, 4, 8)
    ]
    return [network for network in wanted if network not in networks.records]


def _estimate(parts: Sequence[SceneBench]) -> float:
    """Predicted seconds of the run, printed scene by scene."""
    seconds = []
    for part in parts:
        seconds.append(part.estimate())
        report_line(f"{part.name}: about {duration(seconds[-1])}")
    report_line(f"all of it: about {duration(sum(seconds))}")
    return sum(seconds)


def _results(parts: Sequence[SceneBench], chosen: Settings) -> Report:
    scenes = [part.summary() | {"picks": part.picks} for part in parts]
    results: Report = {
        "settings": {
            "budgets": list(chosen.budgets),
            "rounds": chosen.rounds,
            "reference_samples": chosen.reference_samples,
            "networks": [network._asdict() for network in chosen.sweep.networks],
            "without_weights": [list(n) for n in _absent(chosen.networks)],
        },
        "machine": machine.describe(chosen.networks.device),
        "scenes": scenes,
        "points": [point for part in parts for point in part.points()],
        "failures": chosen.journal.failures,
    }
    if chosen.timing:
        results = analysis.analysed(results, chosen.budgets)
    return results


def write(out: Path, results: Report) -> None:
    """Write results.json and results.csv."""
    write_json(out / "results.json", results)
    rows = [_flat(point) for point in results["points"]]
    write_table(out / "results.csv", rows)


def _flat(point: dict[str, Any]) -> dict[str, Any]:
    """One row: settings and seconds as columns of their own."""
    row = {k: v for k, v in point.items() if k not in {"settings", "seconds"}}
    stages = point.get("seconds", {})
    return (
        row
        | point["settings"]
        | {f"seconds_{stage}": seconds for stage, seconds in stages.items()}
    )
