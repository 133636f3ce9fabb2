"""`make demo`: render the still life by every method and compare them.

Writes pictures, guides, comparison.png and results.json into a folder.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from xrds_blender.command import console
from xrds_blender.command.picture_file import save
from xrds_blender.interface.registration import ensure_registered
from xrds_core import exr
from xrds_core.arrays import Array
from xrds_core.atomic import write_json

from . import comparison
from .contest import Contest, Entry
from .scene import build

SCALES = (2, 4)
TOTAL_SECONDS = 300.0  # of the whole demo; the reference takes what the rest leaves


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo and return its exit status."""
    options = _parser().parse_args(argv)
    return console.status_of(lambda: _demo(options))


def _demo(options: argparse.Namespace) -> None:
    start = time.perf_counter()
    ensure_registered()
    scene = build(*options.resolution)
    contest = Contest(scene, options.preset, options.weights)
    contest.warm_up()
    entries: list[Entry] = []
    for scale in SCALES:
        entries.append(contest.xrds(scale))
        name = f"cycles_at_the_time_of_x{scale}"
        entries.append(contest.plain_in(entries[-1].seconds, name))
    left = options.seconds - (time.perf_counter() - start)
    reference = contest.reference(left)
    options.out.mkdir(parents=True, exist_ok=True)
    _write_pictures(options.out, [*entries, reference], scene)
    results = {entry.name: entry.errors(reference.picture) for entry in entries}
    comparison.compare(
        _columns(entries, reference, results), options.out / "comparison.png"
    )
    _write_results(options.out / "results.json", results, reference)
    for entry in entries:
        errors = results[entry.name]
        print(
            f"{entry.label:24} {errors['seconds']:6.2f} s  "
            f"PSNR {errors['psnr']:6.2f} dB  RelMSE {errors['relmse']:.5f}"
        )
    print(f"look at {options.out / 'comparison.png'}")


def _columns(
    entries: Sequence[Entry], reference: Entry, results: dict[str, dict[str, float]]
) -> list[tuple[str, Array]]:
    """Labels and pictures, from the least to the most that was rendered."""
    height, width = reference.picture.alpha.shape
    low = comparison.enlarged(entries[-2].picture.low_resolution, height, width)
    columns = [(f"what XRDS x{SCALES[-1]} is given\n(low resolution)", low)]
    for entry in reversed(entries):
        errors = results[entry.name]
        figures = f"{errors['seconds']:.1f} s, {errors['psnr']:.1f} dB"
        columns.append((f"{entry.label}\n{figures}", entry.picture.radiance))
    final = f"{reference.label}\n{reference.seconds:.0f} s"
    return [*columns, (final, reference.picture.radiance)]


def _write_pictures(folder: Path, entries: Sequence[Entry], scene: Any) -> None:
    """Write every method's picture and the network's inputs."""
    for entry in entries:
        picture = entry.picture
        for suffix in (".exr", ".png"):
            path = folder / f"{entry.name}{suffix}"
            save(path, picture.radiance, picture.alpha, scene)
        if not entry.name.startswith("xrds"):
            continue
        low = picture.low_resolution
        opaque = np.ones(low.shape[:2], np.float32)
        save(folder / f"{entry.name}_input.png", low[..., :3], opaque, scene)
        guides = {"albedo": picture.albedo, "normal": picture.normal}
        channels = {
            f"{name}.{axis}": guide[..., i]
            for name, guide in guides.items()
            for i, axis in enumerate("RGB" if name == "albedo" else "XYZ")
        }
        exr.write_picture(folder / f"{entry.name}_guides.exr", channels)
        opaque = np.ones(picture.alpha.shape, np.float32)
        save(folder / f"{entry.name}_albedo.png", picture.albedo, opaque, scene)
        shown = picture.normal * 0.5 + 0.5
        save(folder / f"{entry.name}_normal.png", shown, opaque, scene)


def _write_results(
    path: Path, results: dict[str, dict[str, float]], reference: Entry
) -> None:
    report = {
        "methods": results,
        "reference": {"label": reference.label, "seconds": reference.seconds},
    }
    write_json(path, report)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--out", type=Path, default=Path("demo"))
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--weights", type=Path, help="folder of weights files")
    parser.add_argument("--seconds", type=float, default=TOTAL_SECONDS)
    parser.add_argument(
        "--resolution", type=int, nargs=2, default=(960, 540), metavar=("W", "H")
    )
    return parser


if __name__ == "__main__":
    console.prepare()
    console.leave(main())
