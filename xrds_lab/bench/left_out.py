"""`xrds bench left-out`: seconds of what a super-resolution picture does without.

A scene's picture is rendered as planned, and with nothing left out, in turns. Seconds
that both take alike, of low-resolution samples and their denoising, are left aside.
"""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_blender.planning.plan import GUIDE_CACHE, SAVINGS, savings_but
from xrds_core.files import read_json, write_json

from ..csv_table import write_table
from ..metrics import psnr
from ..progress import report_line
from . import machine
from .folder_of_report import make_folder
from .inputs import Folder, open_scene
from .journal import Journal
from .windows import find_shots

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from xrds_blender.rendering.picture import Picture

    from .windows import Shot

    Row = dict[str, Any]

SCALE, SAMPLES, GUIDE_SAMPLES = 2, 16, 4
ROUNDS = 3
_EQUAL = 99.0  # dB, where not one bit differs
_SAMPLING = ("beauty", "denoise", "total")


def bench_left_out(
    scenes: Sequence[Path],
    out: Path,
    *,
    resolution: tuple[int, int] | None = None,
    rounds: int = ROUNDS,
) -> dict[str, Any]:
    """Measure stills of scene files, write the report into `out` and return it.

    To be run on a quiet machine; seconds are medians over `rounds`. Raises UsageError
    for missing files, before anything is rendered.
    """
    make_folder(out)
    folder = Folder(out / "cache")
    journal = Journal(folder.directory / "journal-left-out.json", report_line)
    with console.stdout_to(folder.directory / "blender.log"):
        shots = find_shots(scenes, None, None, resolution)
        for shot in shots:
            with journal.attempt(f"{shot.name}: left out"):
                _measure(_path(shot, folder, rounds), shot, rounds)
    paths = (_path(shot, folder, rounds) for shot in shots)
    rows: list[Row] = [read_json(path) for path in paths if path.is_file()]
    results = {
        "settings": {
            "scale": SCALE,
            "samples": SAMPLES,
            "guide_samples": GUIDE_SAMPLES,
            "rounds": rounds,
        },
        "machine": machine.describe(),
        "shots": rows,
        "failures": journal.failures,
    }
    write_json(out / "results.json", results)
    columns = [{k: v for k, v in row.items() if k != "decisions"} for row in rows]
    write_table(out / "results.csv", columns)
    return results


def _path(shot: Shot, folder: Folder, rounds: int) -> Path:
    return folder.directory / f"{shot.identity}-{rounds}-left-out.json"


def _measure(path: Path, shot: Shot, rounds: int) -> None:
    """Keep a scene's row in a file, unless it is there."""
    if not path.is_file():
        row = _measured(shot, rounds)
        write_json(path, row)
        report_line(f"{shot.name}: {row['saved']:.0%} saved")


def _measured(shot: Shot, rounds: int) -> Row:
    scene = open_scene(shot.path, shot.window)
    ways = {"planned": savings_but(GUIDE_CACHE), "all": ()}
    runs: dict[str, list[Picture]] = {name: [] for name in ways}
    _render(scene, SAVINGS)  # loads what a first picture loads
    for _ in range(rounds):
        for name, savings in ways.items():
            runs[name].append(_render(scene, savings))
    taken = {
        name: {stage: _median(pictures, stage) for stage in pictures[0].seconds}
        for name, pictures in runs.items()
    }
    planned, whole = (_beside_samples(taken[name]) for name in ways)
    shown, full = (runs[name][0].radiance for name in ways)
    stops = float(scene.view_settings.exposure)
    plan = runs["planned"][0].plan
    return {
        "scene": shot.name,
        "size": f"{shot.window.width}x{shot.window.height}",
        "seconds_all": round(whole, 3),
        "seconds_planned": round(planned, 3),
        "saved": round(1.0 - planned / whole, 3),
        **{
            f"{stage}_{name}": round(taken[name].get(stage, 0.0), 3)
            for stage in ("guides", "network")
            for name in ways
        },
        "psnr": round(min(psnr(shown, full, stops), _EQUAL), 2),
        "decisions": {each.decision: each.value for each in plan},
    }


def _render(scene: Any, savings: tuple[str, ...]) -> Picture:
    from xrds_blender import render

    return render(
        scene,
        scale=SCALE,
        samples=SAMPLES,
        guide_samples=GUIDE_SAMPLES,
        savings=savings,
    )


def _median(pictures: Sequence[Picture], stage: str) -> float:
    return statistics.median(x.seconds.get(stage, 0.0) for x in pictures)


def _beside_samples(seconds: dict[str, float]) -> float:
    return sum(x for name, x in seconds.items() if name not in _SAMPLING)
