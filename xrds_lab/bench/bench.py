"""`xrds bench`: error against run time of every method, on this machine.

One call measures, resumes and reports: whatever an earlier call with the same output
folder has measured is kept, and the report is written anew after every scene.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_blender.planning.budget import Network
from xrds_core.atomic import replacing, write_json
from xrds_core.errors import UsageError

from . import analysis, machine, report, workload
from .growth import growth as measure_growth
from .inputs import Folder
from .journal import Journal
from .measure import SceneBench, Settings
from .pictures import Networks
from .stages import ROUNDS
from .sweep import Sweep
from .windows import Shot, Window, digest, read_windows

if TYPE_CHECKING:
    Report = dict[str, Any]

BUDGETS = (0.5, 1.0, 2.0, 4.0, 8.0)
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
    growth: Sequence[tuple[int, int]] = (),
    model: Path | None = None,
    weights: Path | None = None,
    device: str = "auto",
    sweep: Sweep | None = None,
) -> Report:
    """Measure scene files and write the report into ``out``; returns results.json.

    ``budgets`` are multiples of a scene's own seconds for one sample and Blender's
    default denoiser. ``windows`` (a file) and ``references`` (a folder of NAME.exr)
    are as for `evaluate`; without them errors are of the whole frame, against the
    mean of two renders of ``reference_samples`` each. ``resolution`` replaces the
    files' own. ``presets`` None takes all whose weights are there. Without ``timing``
    only errors are measured. ``growth`` are frame sizes at which the first scene is
    timed beside. ``model`` is where to write the picker's model.
    Raises UsageError for missing files and unknown names, before anything is rendered.
    """
    out.mkdir(parents=True, exist_ok=True)
    networks = Networks(weights, device)
    folder = Folder(cache or out / "cache")
    assert folder.directory is not None
    folder.directory.mkdir(parents=True, exist_ok=True)
    journal = Journal(folder.directory / "journal.json", _say)
    chosen = Settings(
        sweep or Sweep(_chosen(networks, presets)),
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
        shots = find_shots(scenes, resolution, windows, references)
        parts = [SceneBench(shot, chosen) for shot in shots]
        _tell_missing(networks, presets)
        told = _measured(parts, chosen, out, growth)
    if model is not None:
        _write_model(model, parts, told)
    return told


def _measured(
    parts: Sequence[SceneBench],
    chosen: Settings,
    out: Path,
    growth: Sequence[tuple[int, int]],
) -> Report:
    """Scene by scene, with a report of those that are done after each."""
    meter = workload.Meter(_estimate(parts, growth))
    chosen.journal.say = meter.say
    told: Report = {}
    try:
        for number, part in enumerate(parts, 1):
            part.measure(meter)
            told = _report(parts[:number], chosen)
            write(out, told)
            report.write(out, told, parts[:number])
        if growth:
            told["growth"] = _growth(parts[0], growth, chosen, meter)
            write(out, told)
            report.write(out, told, parts)
    finally:
        meter.close()
    return told


def find_shots(
    scenes: Sequence[Path],
    resolution: tuple[int, int] | None,
    windows: Path | None,
    references: Path | None,
) -> list[Shot]:
    """A shot of each scene; raises UsageError for what is missing or contradicts."""
    if windows is not None and resolution is not None:
        raise UsageError(
            "windows lie in frames of their own size: give --windows or --resolution"
        )
    if references is not None and windows is None:
        raise UsageError("references show windows: give --windows with --references")
    known = {} if windows is None else read_windows(windows)
    names = [path.stem for path in scenes]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(f"two scenes are named {twice[0]}; rename one")
    return [_shot(path, resolution, known, windows, references) for path in scenes]


def _shot(
    path: Path,
    resolution: tuple[int, int] | None,
    known: dict[str, Window],
    windows: Path | None,
    references: Path | None,
) -> Shot:
    if not path.is_file():
        raise UsageError(f"there is no scene {path}")
    if windows is not None and path.stem not in known:
        raise UsageError(f"{windows} has no window for {path.stem}")
    reference = None if references is None else references / f"{path.stem}.exr"
    if reference is not None and not reference.is_file():
        raise UsageError(f"there is no reference {reference} for {path}")
    window = known.get(path.stem) or _whole(path, resolution)
    return Shot(path, window, reference, digest(path))


def _whole(path: Path, resolution: tuple[int, int] | None) -> Window:
    if resolution is None:
        from xrds_blender.command.scene_file import open_scene

        render = open_scene(path).render
        share = render.resolution_percentage
        width, height = (
            size * share // 100 for size in (render.resolution_x, render.resolution_y)
        )
    else:
        width, height = resolution
    return Window(width, height, 0, 0, width, height)


def _chosen(networks: Networks, presets: Sequence[str] | None) -> tuple[Network, ...]:
    return tuple(n for n in networks.records if presets is None or n[0] in presets)


def _tell_missing(networks: Networks, presets: Sequence[str] | None) -> None:
    lacking = [
        f"{preset} x{scale} {guides}"
        for preset, scale, guides in _absent(networks)
        if presets is None or preset in presets
    ]
    if lacking:
        _say(f"no weights, left out: {', '.join(lacking)}")


def _absent(networks: Networks) -> list[Network]:
    """Networks of the product without weights."""
    wanted = [
        (preset, scale, guides)
        for preset in ("fast", "balanced")
        for scale in (2, 4, 8)
        for guides in ("fast", "full")
    ]
    return [network for network in wanted if network not in networks.records]


def _growth(
    part: SceneBench,
    sizes: Sequence[tuple[int, int]],
    chosen: Settings,
    meter: workload.Meter,
) -> dict[str, Any]:
    per_megapixel = part.unit() / part.megapixels

    def tell(megapixels: float, what: str) -> None:
        meter.done(megapixels * per_megapixel, f"growth: {what}")

    return measure_growth(part.shot, sizes, chosen, tell)


def _estimate(parts: Sequence[SceneBench], growth: Sequence[tuple[int, int]]) -> float:
    """Predicted seconds of the run, told scene by scene as they are probed."""
    seconds = []
    for part in parts:
        seconds.append(part.estimate())
        _say(f"{part.name}: about {workload.spoken(seconds[-1])}")
    if growth:
        first, pixels = parts[0], sum(w * h for w, h in growth) / 1e6
        seconds.append(first.growth_estimate(pixels))
        _say(f"growth: at most about {workload.spoken(seconds[-1])}")
    _say(f"all of it: about {workload.spoken(sum(seconds))}")
    return sum(seconds)


def _report(parts: Sequence[SceneBench], chosen: Settings) -> Report:
    scenes = [part.summary() | {"picks": part.picks} for part in parts]
    told: Report = {
        "settings": {
            "budgets": list(chosen.budgets),
            "rounds": chosen.rounds,
            "reference_samples": chosen.reference_samples,
            "networks": [
                dict(zip(("preset", "scale", "guides"), n, strict=True))
                for n in chosen.sweep.networks
            ],
            "without_weights": [list(n) for n in _absent(chosen.networks)],
        },
        "machine": machine.describe(chosen.networks.device),
        "scenes": scenes,
        "points": [point for part in parts for point in part.points()],
        "failures": chosen.journal.failures,
    }
    if chosen.timing:
        told = analysis.analysed(told, chosen.budgets)
    return told


def write(out: Path, told: Report) -> None:
    """results.json and results.csv."""
    write_json(out / "results.json", told)
    rows = [_flat(point) for point in told["points"]]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with (
        replacing(out / "results.csv") as part,
        part.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)


def _flat(point: dict[str, Any]) -> dict[str, Any]:
    """One row: settings and seconds as columns of their own."""
    row = {k: v for k, v in point.items() if k not in {"settings", "seconds"}}
    stages = point.get("seconds", {})
    return (
        row
        | point["settings"]
        | {f"seconds_{stage}": seconds for stage, seconds in stages.items()}
    )


def _write_model(path: Path, parts: Sequence[SceneBench], told: Report) -> None:
    write_json(path, analysis.fitted(parts, told["points"]).to_json())


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
