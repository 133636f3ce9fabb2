"""The page of a measure of shots: tables of means and of the worst scene."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

from . import blocks, comparison
from .frames import REACH
from .methods import BEST, DEFAULT, MEDIAN, NL_MEANS, XRDS
from .motions import MOTIONS
from .seeds import over_seeds

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    Point = dict[str, Any]
    Case = tuple[str, int]

_NAMES = {
    DEFAULT: "Cycles + OIDN, default",
    BEST: "Cycles + OIDN, best mode",
    MEDIAN: "median of three",
    NL_MEANS: "non-local means",
}
_INTRODUCTION = """# Shots

Written by `xrds bench shots`. Each scene is made a shot of nine frames (17 for a
temporal radius of 8), whose middle frame is the file's own view. Two raw renders judge
it, without their noise, or a reference that was given. All methods get the same
samples. PSNR in dB and FLIP are of the middle frame, in sRGB at the scene's exposure. A
*gain* is in dB over Cycles + OIDN's default on that frame alone. *Best mode* is the
best of Cycles' nine modes for each scene and shot, found with the reference. *Median of
three* moves the denoised neighbours onto the frame by the Vector pass and takes the
median, as SID-Temporal does.
*Non-local means* averages what looks alike in three noisy frames, as noice does: an
implementation of our own, small, with guides cleaned by Open Image Denoise.

*Flicker* is a ratio to Cycles + OIDN's default: how much errors change from the middle
frame to the next along the motion, root mean square."""


def write(path: Path, results: dict[str, Any]) -> None:
    """Write the page as Markdown."""
    with replacing(path) as part:
        part.write_text(page(results), "utf-8")


def page(results: dict[str, Any]) -> str:
    """The page of `results.json`."""
    points = over_seeds(results["shots"])
    sections = [
        _INTRODUCTION,
        "\n".join(f"- `{name}`: {meaning}." for name, meaning in MOTIONS.items()),
        *_gains(points),
        *comparison.sections(results),
        *blocks.section(points),
        *_seconds(points, results["settings"].get("seconds_resolution")),
        *_by_scene(points),
        *_failures(results["failures"]),
    ]
    return "\n\n".join(sections) + "\n"


def cases(points: Sequence[Point]) -> list[Case]:
    """The shots that were measured: motion and samples, in the order of the motions."""
    order = list(MOTIONS)
    found = {(point["motion"], point["samples"]) for point in points}
    return sorted(found, key=lambda case: (order.index(case[0]), case[1]))


def compared(
    points: Sequence[Point], case: Case, method: str, radius: int, rival: str = DEFAULT
) -> list[tuple[Point, Point]]:
    """A method's points of one shot, each with the rival's of the same scene."""
    motion, samples = case
    here = [p for p in points if (p["motion"], p["samples"]) == (motion, samples)]
    rivals = {p["scene"]: p for p in here if p["method"] == rival}
    return [
        (point, rivals[point["scene"]])
        for point in here
        if (point["method"], point["radius"]) == (method, radius)
        and point["scene"] in rivals
    ]


def _gains(points: Sequence[Point]) -> Iterator[str]:
    yield f"## Gain at radius {REACH}"
    lines = [
        "| camera, samples per frame | scenes | gain | worst scene | over best mode "
        "| worst | over median of three | worst | over non-local means | worst "
        "| FLIP, default | FLIP, XRDS | flicker | worst |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for case in cases(points):
        pairs = compared(points, case, XRDS, REACH)
        if not pairs:
            continue
        cells = [f"{case[0]}, {case[1]}", str(len(pairs))]
        for rival in (DEFAULT, BEST, MEDIAN, NL_MEANS):
            cells += _mean_and_worst(compared(points, case, XRDS, REACH, rival))
        cells.append(f"{statistics.fmean(o['flip'] for _, o in pairs):.4f}")
        cells.append(f"{statistics.fmean(x['flip'] for x, _ in pairs):.4f}")
        cells += _flicker(pairs)
        lines.append(f"| {' | '.join(cells)} |")
    yield "\n".join(lines)
    yield "## Gain and flicker by radius"
    radii = sorted({p["radius"] for p in points if p["method"] == XRDS})
    lines = [
        "| camera, samples per frame | "
        + " | ".join(f"radius {r} | worst | flicker" for r in radii)
        + " |",
        "|---|" + "---|" * 3 * len(radii),
    ]
    for case in cases(points):
        cells = [f"{case[0]}, {case[1]}"]
        for radius in radii:
            pairs = compared(points, case, XRDS, radius)
            cells += [*_mean_and_worst(pairs), _flicker(pairs)[0]]
        lines.append(f"| {' | '.join(cells)} |")
    yield "\n".join(lines)


def _mean_and_worst(pairs: Sequence[tuple[Point, Point]]) -> list[str]:
    if not pairs:
        return ["-", "-"]
    gains = {x["scene"]: x["psnr"] - o["psnr"] for x, o in pairs}
    scene = min(gains, key=lambda name: gains[name])
    return [f"{statistics.fmean(gains.values()):+.2f}", f"{gains[scene]:+.2f} {scene}"]


def _flicker(pairs: Sequence[tuple[Point, Point]]) -> list[str]:
    ratios = {
        x["scene"]: x["flicker"] / o["flicker"]
        for x, o in pairs
        if x["flicker"] is not None and o["flicker"]
    }
    if not ratios:
        return ["-", "-"]
    scene = max(ratios, key=lambda name: ratios[name])
    return [f"{statistics.fmean(ratios.values()):.2f}", f"{ratios[scene]:.2f} {scene}"]


def _seconds(points: Sequence[Point], size: Sequence[int] | None) -> Iterator[str]:
    known = [p for p in points if p["seconds_per_frame"] and p["motion"] == "pan"]
    if not known:
        return
    yield "## Seconds per frame"
    of = "whole frames" if size is None else f"frames of {size[0]}x{size[1]}"
    yield f"Of {of}, all that the user waits for; medians of runs in turns."
    scenes = list(dict.fromkeys(p["scene"] for p in known))
    lines = [
        "| method, samples | " + " | ".join(scenes) + " |",
        "|---|" + "---|" * len(scenes),
    ]
    rows: dict[str, dict[str, float]] = {}
    for p in known:
        name = f"{_method(p)}, {p['samples']}"
        rows.setdefault(name, {})[p["scene"]] = p["seconds_per_frame"]
    for name, row in rows.items():
        cells = [f"{row[s]:.1f}" if s in row else "-" for s in scenes]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    yield "\n".join(lines)


def _by_scene(points: Sequence[Point]) -> Iterator[str]:
    yield "## PSNR by scene"
    for case in cases(points):
        here = [p for p in points if (p["motion"], p["samples"]) == case]
        scenes = list(dict.fromkeys(p["scene"] for p in here))
        rows: dict[str, dict[str, float]] = {}
        for p in sorted(here, key=lambda p: (p["method"] == XRDS, p["radius"])):
            rows.setdefault(_method(p), {})[p["scene"]] = p["psnr"]
        lines = [
            f"| {case[0]}, {case[1]} spp | " + " | ".join(scenes) + " | mean |",
            "|---|" + "---|" * (len(scenes) + 1),
        ]
        for name, row in rows.items():
            cells = [f"{row[s]:.2f}" if s in row else "-" for s in scenes]
            mean = statistics.fmean(row.values())
            lines.append(f"| {name} | {' | '.join(cells)} | {mean:.2f} |")
        yield "\n".join(lines)


def _method(point: Point) -> str:
    name = _NAMES.get(point["method"])
    return name or f"XRDS, radius {point['radius']}"


def _failures(failures: dict[str, str]) -> Iterator[str]:
    if failures:
        yield "## Left out"
        yield "\n".join(f"- {name}: {why}" for name, why in failures.items())
