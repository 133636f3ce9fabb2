"""The gallery's report: JSON, CSV, and a page that shows what is worse."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from xrds_core.files import replacing, write_json

from ..csv_table import write_table
from .judge import BLOCK, LOSS, SHARE, WORST_LOSS
from .table import HALVES, SHOTS

Point = dict[str, Any]
RESULTS = "results.json"
LARGEST = 1_500_000  # bytes of crops in a page
ENLARGED = 4
_COLUMNS = {
    "shot": "shot",
    "half": "half",
    "samples": "samples",
    "passed": "passed",
    "gain": "gain (dB)",
    "worst_block": "worst block (dB)",
    "share": f"share below -{LOSS:g} dB",
    "bare_worst_block": "worst block, bare",
    "bare_share": "share, bare",
    "flicker": "flicker",
    "psnr": "PSNR",
    "psnr_alone": "PSNR alone",
    "image_share": "images, share",
    "image_gain": "images, gain (dB)",
    "surface_gain": "the same by surfaces",
    "followed_share": "followed, share",
    "moved_share": "of them moved, share",
}
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 76em; }
table { border-collapse: collapse; }
td, th { padding: .15em .6em; text-align: right; border-bottom: 1px solid #8884; }
td:first-child, td:nth-child(2), th:first-child { text-align: left; }
tr.worse { background: #f002; }
figure { display: inline-block; margin: .3em .6em .6em 0; }
img { image-rendering: pixelated; display: block; }
figcaption { font-size: 85%; }
"""


def write(out: Path, results: dict[str, Any]) -> None:
    """Write results.json, results.csv and report.html into a folder."""
    bare = results | {"shots": [_without_crops(p) for p in results["shots"]]}
    write_json(out / RESULTS, bare)
    rows = [{name: p.get(name) for name in _COLUMNS} for p in results["shots"]]
    write_table(out / "results.csv", rows)
    with replacing(out / "report.html") as part:
        part.write_text(page(results), "utf-8")


def _without_crops(point: Point) -> Point:
    frames = [
        {name: value for name, value in frame.items() if name != "crops"}
        for frame in point["frames"]
    ]
    return point | {"frames": frames}


def page(results: dict[str, Any]) -> str:
    """The page of `results.json`, its crops included."""
    points = results["shots"]
    parts = [
        "<!doctype html><meta charset=utf-8><title>Gallery</title>",
        f"<style>{_STYLE}</style><h1>Gallery</h1>",
        f"<p>{_introduction(results['settings'])}</p>",
        _summary(points),
        _table(points),
        *_worse(points),
        _tested(points),
        *_left_out(results["failures"]),
    ]
    return "\n".join(parts) + "\n"


def _introduction(settings: Point) -> str:
    return (
        "Written by <code>xrds bench gallery</code>. Each shot has nine frames; the "
        "middle one and the first are finished with their neighbours' samples and "
        "alone, at the same samples, and judged against two references of "
        f"{settings['reference_samples']} samples and independent noise, as the mean "
        "of (x - R)(x - S) in sRGB. The rule: no picture is worse, at most "
        f"{SHARE:.0%} of its blocks of {BLOCK}x{BLOCK} pixels lose more than {LOSS:g} "
        f"dB, none more than {WORST_LOSS:g} dB. A squared error of 1e-5, which nobody "
        "sees, is added on both sides; 'bare' is without. Worst and share are of both "
        "frames, colour and alpha; gain and PSNR of the middle frame. Flicker, where "
        "the camera stands still: the median second difference of three frames, as a "
        "ratio to frames alone. Images are what mirrors and glass show under a moving "
        "camera: gains on their pixels, found by surfaces and by images."
    )


def _summary(points: Sequence[Point]) -> str:
    rows = ["<h2>By half and samples</h2><table>"]
    names = ("half", "samples", "shots", "keep the rule", "mean gain", "worst block")
    rows.append(_row("th", names))
    for half in HALVES:
        for samples in sorted({p["samples"] for p in points}):
            here = [p for p in points if (p["half"], p["samples"]) == (half, samples)]
            if not here:
                continue
            worst = min(here, key=lambda p: p["worst_block"])
            cells = (
                half,
                samples,
                len(here),
                sum(p["passed"] for p in here),
                f"{statistics.fmean(p['gain'] for p in here):+.2f}",
                f"{worst['worst_block']:+.2f} {worst['shot']}",
            )
            rows.append(_row("td", cells))
    return "\n".join([*rows, "</table>"])


def _table(points: Sequence[Point]) -> str:
    rows = ["<h2>Shots</h2><table>", _row("th", tuple(_COLUMNS.values()))]
    for point in points:
        cells = tuple(_cell(name, point.get(name)) for name in _COLUMNS)
        rows.append(_row("td", cells, "" if point["passed"] else "worse"))
    return "\n".join([*rows, "</table>"])


def _cell(name: str, value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if name.endswith("share"):
        return f"{value:.1%}"
    if name.endswith(("gain", "block")):
        return f"{value:+.2f}"
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _row(cell: str, values: tuple[Any, ...], kind: str = "") -> str:
    cells = "".join(f"<{cell}>{escape(str(value))}</{cell}>" for value in values)
    return f'<tr class="{kind}">{cells}</tr>' if kind else f"<tr>{cells}</tr>"


def _worse(points: Sequence[Point]) -> Iterator[str]:
    """Crops of the worst blocks, the worst first, as many as fit."""
    found = [
        (crop["loss"], point, frame["frame"], crop)
        for point in points
        for frame in point["frames"]
        for crop in frame.get("crops", ())
    ]
    if not found:
        return
    yield f"<h2>Worst blocks of what breaks the rule, x{ENLARGED}</h2>"
    left = LARGEST
    for loss, point, number, crop in sorted(found, key=lambda each: each[0]):
        shown = "".join(_figure(crop, name) for name in ("alone", "shot", "reference"))
        left -= len(shown)
        if left < 0:
            yield "<p>Others are left out: the page would grow too large.</p>"
            return
        title = f"{point['shot']}, {point['samples']} samples, frame {number}"
        row, column = crop["place"]
        where = f"{crop['what']} {loss:+.1f} dB at ({column}, {row})"
        yield f"<h3>{escape(title)}: {where}</h3>{shown}"


def _figure(crop: Point, name: str) -> str:
    side = 2 * BLOCK * ENLARGED
    picture = f'<img src="{crop[name]}" height="{side}" alt="{name}">'
    return f"<figure>{picture}<figcaption>{name}</figcaption></figure>"


def _tested(points: Sequence[Point]) -> str:
    names = dict.fromkeys(point["shot"] for point in points)
    rows = [_row("td", (name, SHOTS[name].what)) for name in names]
    return "\n".join(["<h2>What each shot tests</h2><table>", *rows, "</table>"])


def _left_out(failures: dict[str, str]) -> Iterator[str]:
    if failures:
        yield "<h2>Left out</h2><ul>"
        yield from (f"<li>{escape(f'{n}: {why}')}</li>" for n, why in failures.items())
        yield "</ul>"
