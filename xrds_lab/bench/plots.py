"""Error against seconds, drawn for screen and print."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from . import pareto

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Point = dict[str, Any]
    Line = list[tuple[float, float]]

MEASURES = {"psnr": "PSNR, dB (sRGB)", "relmse_trimmed": "RelMSE, trimmed"}
# Colour, line and mark differ each by itself: readable in grey and by the colour-blind.
STYLES = {
    "Cycles": ("#999999", ":", "."),
    "OIDN, default": ("#d55e00", "--", "s"),
    "OIDN, best mode": ("#000000", "-", "o"),
    "OIDN, adaptive sampling": ("#e69f00", "--", "P"),
    "bicubic": ("#bbbbbb", "-.", "v"),
    "demodulated bilinear": ("#cc79a7", "-.", "^"),
    pareto.CACHED: ("#56b4e9", "--", "d"),
    "XRDS": ("#0072b2", "-", "D"),  # above the line before, from which it seldom parts
}
SIZE = (9.0, 4.2)  # inches; two panels


def scene_plot(
    scene: str, points: Sequence[Point], unit: float, floor: float | None
) -> bytes:
    """SVG of one scene: all points, each group's frontier, the reference's floor."""
    figure, panels = two_panels(as_text(scene), "seconds of a whole frame")
    groups = pareto.groups(points)
    for panel, measure in zip(panels, MEASURES, strict=True):
        for name in STYLES:
            if name in groups:
                _group(panel, name, groups[name], measure)
        panel.axvline(unit, color="#cccccc", zorder=0, linewidth=1)
        if measure == "psnr" and floor is not None:
            panel.axhline(floor, color="#009e73", linewidth=1, linestyle=":")
            panel.text(0.99, floor, "the reference's own error", fontsize=7, ha="right",
                       va="bottom", transform=panel.get_yaxis_transform())  # fmt: skip
    return svg_of(figure, panels, outside=True)


def mean_plot(scenes: dict[str, tuple[Sequence[Point], float]]) -> bytes:
    """SVG over all scenes: mean error over multiples of 1 spp + OIDN's seconds."""
    title = f"mean over {len(scenes)} scenes"
    figure, panels = two_panels(title, "budget, of 1 spp + OIDN (Blender's default)")
    grouped = {
        name: (pareto.groups(points), unit) for name, (points, unit) in scenes.items()
    }
    for panel, measure in zip(panels, MEASURES, strict=True):
        for name in STYLES:
            members = {
                scene: (groups.get(name, []), unit)
                for scene, (groups, unit) in grouped.items()
            }
            _draw(panel, name, pareto.mean_curve(members, measure))
        panel.axvline(1.0, color="#cccccc", zorder=0, linewidth=1)
    return svg_of(figure, panels, outside=True)


def gain_plot(entries: Sequence[dict[str, Any]]) -> bytes:
    """SVG of how many times as long Cycles takes for XRDS's picture, over budgets.

    Samples beside seconds; a line for each scene, from `same_picture.entries`.
    """
    title = "the same PSNR: Cycles' best mode, as a multiple of XRDS"
    figure, panels = two_panels(title, "budget, of 1 spp + OIDN (Blender's default)")
    keys = (("seconds", "seconds"), ("samples", "samples per pixel"))
    budgets = sorted({e["budget"] for e in entries})
    for panel, (key, label) in zip(panels, keys, strict=True):
        panel.set_xticks(budgets, [f"{budget:g}" for budget in budgets])
        panel.set_xticks([], minor=True)
        panel.set_yscale("linear")  # a factor near 1: a log axis has no numbers there
        panel.set_ylabel(f"times the {label}")
        panel.axhline(1.0, color="#cccccc", zorder=0, linewidth=1)
        for number, scene in enumerate(dict.fromkeys(e["scene"] for e in entries)):
            here = [e for e in entries if e["scene"] == scene and e[f"rival_{key}"]]
            line = sorted((e["budget"], e[f"rival_{key}"] / e[key]) for e in here)
            if line:
                panel.plot(*zip(*line, strict=True), color=f"C{number}",
                           label=as_text(scene), marker="osD^v<>"[number % 7],
                           markersize=4)  # fmt: skip
    return svg_of(figure, panels)


def as_text(name: str) -> str:
    """A scene's name for a plot, which takes what stands between $ for a formula."""
    return name.replace("$", r"\$")


def two_panels(
    title: str, axis: str, measures: Mapping[str, str] = MEASURES
) -> tuple[Any, Any]:
    """A figure with a panel for each of two measures over a log `axis`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    figure.suptitle(title, fontsize=11)
    panels = figure.subplots(1, 2)
    for panel, (measure, label) in zip(panels, measures.items(), strict=True):
        panel.set_xscale("log")
        _number(panel.xaxis)
        panel.set_xlabel(axis)
        panel.set_ylabel(label)
        panel.grid(visible=True, which="both", linewidth=0.3, color="#dddddd")
        if measure != "psnr":
            panel.set_yscale("log")
    return figure, panels


def _number(axis: Any) -> None:
    """Label a log axis 1, 2, 5, 10: by itself a short one gets labels that overlap."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _group(panel: Any, name: str, members: Sequence[Point], measure: str) -> None:
    """Draw a group: its points faintly, its frontier as a line."""
    colour, _, mark = STYLES[name]
    if name != pareto.CACHED:
        shown = [(p["seconds"]["total"], p[measure]) for p in members]
        panel.scatter(*zip(*shown, strict=True), s=4, color=colour, alpha=0.25,
                      marker=mark, linewidths=0)  # fmt: skip
    line = pareto.frontier(members, measure)
    _draw(panel, name, [(p["seconds"]["total"], p[measure]) for p in line], marks=True)


def _draw(panel: Any, name: str, line: Line, marks: bool = False) -> None:
    if not line:
        return
    colour, dash, mark = STYLES[name]
    panel.plot(
        *zip(*line, strict=True),
        color=colour,
        linestyle=dash,
        linewidth=1.4,
        marker=mark if marks else None,
        markersize=4,
        label=name,
    )


def svg_of(figure: Any, panels: Any, outside: bool = False) -> bytes:
    """A figure with its legend, below the panels or inside the first."""
    from matplotlib import rc_context

    if outside:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=7,
                      frameon=False)  # fmt: skip
    else:
        panels[0].legend(fontsize=7, frameon=False)
    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "xrds"}):  # the same file for the same figures
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
