"""Error against seconds per frame, on a card."""

from __future__ import annotations

from statistics import mean
from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

from ..bench.plots import as_text

if TYPE_CHECKING:
    from pathlib import Path

    Row = dict[str, Any]

_NAMES = {
    ("cycles_oidn", 0): "Cycles + OIDN",
    ("xrds", 0): "XRDS, the frame alone",
    ("xrds", 1): "XRDS, radius 1",
    ("xrds", 2): "XRDS, radius 2",
    ("xrds", 4): "XRDS, radius 4",
}


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw the mean PSNR over the shots at the smallest size, an SVG.

    Raises ImportError without matplotlib.
    """
    import matplotlib as mpl

    mpl.use("svg")
    from matplotlib import pyplot

    rows = results["shots"]
    if not rows:
        return
    size = min((row["size"] for row in rows), key=lambda x: x[0])
    figure, axes = pyplot.subplots(figsize=(7, 4.5))
    for (method, radius), name in _NAMES.items():
        own = [
            row
            for row in rows
            if (row["size"], row["method"], row["radius"]) == (size, method, radius)
        ]
        points = sorted(_points(own, rows))
        if points:
            axes.plot(*zip(*points, strict=True), marker="o", label=name)
    axes.set_xscale("log")
    axes.set_xlabel("seconds per frame")
    axes.set_ylabel("PSNR, dB")
    device = results["machine"]["cycles_device"]
    axes.set_title(as_text(f"{size[0]}x{size[1]}: Cycles on {device}"))
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    with replacing(path) as part:
        figure.savefig(part, format="svg")
    pyplot.close(figure)


def _points(own: list[Row], rows: list[Row]) -> list[tuple[float, float]]:
    """Seconds and PSNR of each number of samples, means over the shots."""
    found = []
    for samples in {row["samples"] for row in own}:
        here = [row for row in own if row["samples"] == samples]
        seconds = [_seconds(row, rows) for row in here]
        known = [x for x in seconds if x is not None]
        if len(known) == len(here):
            found.append((mean(known), mean(row["psnr"] for row in here)))
    return found


def _seconds(row: Row, rows: list[Row]) -> float | None:
    """Of a frame on the card; what follows sampling is that of the timed samples."""
    if row["method"] != "xrds":
        return float(row["total"])
    same = ("shot", "size", "radius", "method")
    timed = [
        x["card_total"]
        for x in rows
        if "card_total" in x and all(x[name] == row[name] for name in same)
    ]
    return float(row["sample"]) + timed[0] if timed else None
