"""Too little time for a sample per pixel: XRDS against a lower resolution percentage.

Without super-resolution an artist lowers the resolution percentage, lets Cycles denoise
with its quickest mode, and enlarges the picture. For each budget of light, in samples
per pixel of the full size, the table holds the best picture of XRDS, and the best that
the other way makes in the same seconds of whole frames, with however many samples.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_blender.command import console
from xrds_blender.planning.settings import Denoising
from xrds_core.files import replacing, write_json

from ..progress import report_line
from . import machine, workload
from .bench import of_presets
from .inputs import Folder
from .journal import Journal
from .measure import SceneBench, Settings
from .pictures import Networks
from .sweep import Config, Sweep, xrds
from .windows import find_shots

if TYPE_CHECKING:
    Point = dict[str, Any]
    Row = dict[str, Any]

BUDGETS = (1 / 16, 1 / 8, 1 / 4, 1 / 2)
LOWERED = {2: (1, 2, 4, 8, 16), 4: (1, 2, 4, 8, 16, 32, 64), 8: (1, 4, 16, 64)}
ENLARGED = {2: (1, 2), 4: (1, 2, 4, 8), 8: (4, 8, 16, 32)}
FRESH, CACHED = 1, 4  # samples of guides rendered now, and of those kept from before
QUICKEST, QUICK = Denoising.FAST_FAST, Denoising.HIGH_FAST
FULL_SIZE = Config("oidn", 1, QUICKEST)
NO_LIMIT = (math.inf,)  # whatever its seconds, every configuration is measured


@dataclass(frozen=True)
class LowSweep(Sweep):
    """Few samples per pixel of the small render, and the full size's first sample."""

    def configurations(self) -> list[Config]:
        """What is compared."""
        lowered = [
            Config("bicubic", n, QUICKEST, scale)
            for scale, counts in LOWERED.items()
            for n in counts
        ]
        enlarged = [
            xrds(network, n, QUICK, guides)
            for network in self.networks
            for n in ENLARGED[network.scale]
            for guides in (FRESH, CACHED)
        ]
        return [FULL_SIZE, *lowered, *enlarged]


def low_budgets(
    scenes: Sequence[Path],
    out: Path,
    *,
    windows: Path | None,
    references: Path | None,
    resolution: tuple[int, int] | None,
    cache: Path | None,
    presets: Sequence[str],
    rounds: int,
    reference_samples: int,
    weights: Path | None,
    device: str,
) -> dict[str, Any]:
    """Measure scene files; write OUT/low_budgets.json and .md, and return the JSON.

    The arguments are `bench`'s. Raises UsageError for missing files, before anything
    is rendered.
    """
    out.mkdir(parents=True, exist_ok=True)
    folder = Folder(cache or out / "cache")
    journal = Journal(folder.directory / "journal.json", report_line)
    networks = Networks(weights, device)
    settings = Settings(
        LowSweep(of_presets(networks, presets)),
        folder,
        networks,
        journal,
        NO_LIMIT,
        rounds,
        reference_samples,
        picker=False,
    )
    with console.stdout_to(folder.directory / "blender.log"):
        shots = find_shots(scenes, windows, references, resolution)
        parts = [SceneBench(shot, settings) for shot in shots]
        meter = workload.Meter(sum(part.estimate() for part in parts))
        journal.progress = meter.write
        try:
            for part in parts:
                part.measure(meter)
        finally:
            meter.close()
        points = [point for part in parts for point in part.points()]
    result = {
        "machine": machine.describe(device),
        "rounds": rounds,
        "presets": list(presets),
        "rows": rows(points),
        "points": points,
        "failures": journal.failures,
    }
    write_json(out / "low_budgets.json", result)
    with replacing(out / "low_budgets.md") as part:
        part.write_text("\n".join(markdown(result["rows"])) + "\n", "utf-8")
    return result


def rows(points: Sequence[Point]) -> list[Row]:
    """For every budget, and guides rendered now or kept: the means over the scenes."""
    return [
        row
        for budget in BUDGETS
        for kept in (False, True)
        if (row := _row(points, budget, kept))
    ]


def _row(points: Sequence[Point], budget: float, kept: bool) -> Row | None:
    """One line of the table; None where no scene has a picture of ours."""
    scenes = dict.fromkeys(point["scene"] for point in points)
    found = [
        _scene([p for p in points if p["scene"] == s], budget, kept) for s in scenes
    ]
    compared = [entry for entry in found if entry is not None]
    if not compared:
        return None
    gains = {entry["scene"]: entry["xrds"] - entry["lowered"] for entry in compared}
    worst = min(gains, key=lambda scene: gains[scene])
    fitting = [entry["full_size"] for entry in compared if entry["full_size"]]
    return {
        "samples": budget,
        "guides": "kept" if kept else "rendered",
        "scenes": compared,
        "xrds": statistics.mean(entry["xrds"] for entry in compared),
        "lowered": statistics.mean(entry["lowered"] for entry in compared),
        "gain": statistics.mean(gains.values()),
        "worst": {"scene": worst, "gain": gains[worst]},
        "full_size_fits": len(fitting),
    }


def _scene(points: Sequence[Point], budget: float, kept: bool) -> dict[str, Any] | None:
    """The best picture of ours within a budget, and the others' in its seconds."""

    def light(point: Point) -> float:
        return point["settings"]["samples"] / point["settings"]["scale"] ** 2

    guides = CACHED if kept else FRESH
    ours = [
        p
        for p in points
        if p["method"] == "xrds"
        and p["settings"]["guide_samples"] == guides
        and light(p) <= budget
    ]
    if not ours:
        return None
    best = max(ours, key=lambda p: p["psnr"])
    stages = best["seconds"]
    seconds = stages["total"] - (stages["guides"] if kept else 0.0)
    within = [p for p in points if p["seconds"]["total"] <= seconds]
    lowered = [p for p in within if p["method"] == "bicubic"]
    if not lowered:
        return None
    rival = max(lowered, key=lambda p: p["psnr"])
    full = next((p["psnr"] for p in within if p["method"] == "oidn"), None)
    return {
        "scene": best["scene"],
        "seconds": seconds,
        "xrds": best["psnr"],
        "xrds_label": best["label"],
        "lowered": rival["psnr"],
        "lowered_label": rival["label"],
        "full_size": full,
    }


def markdown(table: Sequence[Row]) -> list[str]:
    """The table as lines of Markdown."""
    lines = [
        "| samples per pixel | guides | lowered resolution | XRDS | gain: mean, worst "
        "| full size fits as well |",
        "|---|---|---|---|---|---|",
    ]
    for row in table:
        worst = row["worst"]
        lines.append(
            f"| {row['samples']:g} | {row['guides']} | {row['lowered']:.2f} "
            f"| {row['xrds']:.2f} | {row['gain']:+.2f}, {worst['gain']:+.2f} "
            f"{worst['scene']} | {row['full_size_fits']} of {len(row['scenes'])} |"
        )
    return lines
