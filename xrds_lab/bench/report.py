"""report.html: plots, tables and crops in one file that needs nothing beside it."""

from __future__ import annotations

import html
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

from . import analysis, plots
from .crops import viewer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .measure import SceneBench

    Report = dict[str, Any]

PAGE = Path(__file__).with_name("report.html")


def write(out: Path, report: Report, scenes: Sequence[SceneBench]) -> None:
    """Write report.html and the plots as files."""
    timed = {
        scene["scene"]: (
            [p for p in report["points"] if p["scene"] == scene["scene"]],
            scene["default_seconds"],
        )
        for scene in report["scenes"]
        if "default_seconds" in scene
    }
    timed = {name: pair for name, pair in timed.items() if pair[0]}
    sections = [_machine(report), _failures(report)]
    if timed:
        overall = plots.mean_plot(timed)
        (out / "pareto.svg").write_bytes(overall)
        sections[:0] = [
            _figure(overall),
            _mean_table(report),
            _same_picture(out, report["same_picture"]),
            _picker(report),
        ]
    by_name = {scene.name: scene for scene in scenes}
    for scene in report["scenes"]:
        name = scene["scene"]
        sections.append(f"<h2>{html.escape(name)}</h2>")
        if name in timed:
            floor = scene["reference_psnr_floor"]
            svg = plots.scene_plot(name, *timed[name], floor)
            (out / f"pareto-{name}.svg").write_bytes(svg)
            sections += [_facts(report, scene), _figure(svg), _table(report, name)]
            sections.append(viewer(report, by_name[name]))
    page = Template(PAGE.read_text("utf-8")).substitute(body="\n".join(sections))
    with replacing(out / "report.html") as part:
        part.write_text(page, "utf-8")


# --- tables ---------------------------------------------------------------------------


def _rows(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    def cells(tag: str, values: Sequence[object]) -> str:
        shown = "".join(f"<{tag}>{html.escape(str(v))}</{tag}>" for v in values)
        return f"<tr>{shown}</tr>"

    body = "\n".join(cells("td", row) for row in rows)
    return f"<table><thead>{cells('th', head)}</thead><tbody>{body}</tbody></table>"


def _mean_table(report: Report) -> str:
    names = list(dict.fromkeys(n for row in report["mean"] for n in row["groups"]))
    rows = []
    for row in report["mean"]:
        cells = [_mean_cell(row["groups"].get(name), report) for name in names]
        rows.append([f"{row['budget']:g}", *cells, _mean_cell(row["picker"], report)])
    head = ["budget", *names, "picker"]
    note = (
        "Mean PSNR in dB (trimmed RelMSE) of the best configuration within each "
        "budget; budgets are multiples of each scene's own 1 spp + OIDN with "
        "Blender's defaults. In brackets how many scenes had one, where not all."
    )
    return f"<p>{note}</p>{_rows(head, rows)}"


def _mean_cell(mean: dict[str, float] | None, report: Report) -> str:
    if mean is None:
        return "–"
    some = mean["scenes"] < sum("default_seconds" in s for s in report["scenes"])
    count = f" [{mean['scenes']}]" if some else ""
    return f"{mean['psnr']:.2f} ({mean['relmse_trimmed']:.4f}){count}"


def _same_picture(out: Path, entries: Sequence[dict[str, Any]]) -> str:
    """Seconds and samples that Cycles needs for XRDS's PSNR, plotted and as a table."""
    if not entries:
        return ""
    svg = plots.gain_plot(entries)
    (out / "same-picture.svg").write_bytes(svg)
    rows = [
        [
            e["scene"],
            f"{e['budget']:g}",
            e["label"],
            f"{e['psnr']:.2f}",
            f"{e['seconds']:.1f}",
            _reached(e["rival_seconds"], 1),
            _reached(e["gain"], 2),
            f"{e['samples']:.2g}",
            _reached(e["rival_samples"], 1),
        ]
        for e in entries
    ]
    head = ["scene", "budget", "XRDS", "PSNR", "its s", "s of Cycles", "times"]
    note = (
        "XRDS's best picture within each budget, and the seconds that the best mode of "
        "Cycles + OIDN, with adaptive sampling or without, needs for the same PSNR on "
        "that scene. Where XRDS loses (below 1) comes first. Samples are per pixel of "
        "the full size, those of guides counted, adaptive ones left out; interpolated "
        "over the logarithm of seconds or samples."
    )
    table = _rows([*head, "its samples", "samples of Cycles"], rows)
    title = "<h2>The same picture in how many seconds</h2>"
    return f"{title}<p>{note}</p>{_figure(svg)}{table}"


def _reached(value: float | None, digits: int) -> str:
    return "not reached" if value is None else f"{value:.{digits}f}"


def _table(report: Report, scene: str) -> str:
    entries = [e for e in report["budgets"] if e["scene"] == scene]
    names = list(dict.fromkeys(n for e in entries for n in e["best"]))
    rows: list[list[str]] = []
    for entry in entries:
        for name in [*names, "picker"]:
            best = entry["picker"] if name == "picker" else entry["best"].get(name)
            if best is not None:
                seconds = best["seconds"]
                total = seconds["total"] if isinstance(seconds, dict) else seconds
                rows.append(
                    [
                        f"{entry['budget']:g} = {entry['seconds']:.1f} s",
                        name,
                        best["label"],
                        f"{total:.1f}",
                        f"{best['psnr']:.2f}",
                        f"{best['relmse']:.4f}",
                        f"{best['relmse_trimmed']:.4f}",
                        f"{best['flip']:.4f}",
                    ]
                )
    head = ["budget", "group", "best within it", "seconds"]
    measures = ["PSNR", "RelMSE", "trimmed", "FLIP"]
    table = _rows([*head, *measures], rows)
    return f"<details><summary>All budgets</summary>{table}</details>"


def _facts(report: Report, scene: dict[str, Any]) -> str:
    crossing = next(c for c in report["crossings"] if c["scene"] == scene["scene"])
    check = scene["check"]
    floor = scene["reference_psnr_floor"]
    frame, rho = "x".join(map(str, scene["frame"])), scene["rho"]
    facts = [
        f"Frame {frame}; error on the window {scene['window']} against "
        f"{scene['reference']}"
        + (f", good to {floor:.1f} dB." if floor is not None else "."),
        f"1 spp + OIDN (default) takes {scene['default_seconds']:.1f} s "
        f"({check['composed']:.1f} s as sum of its stages). A guide sample costs "
        f"rho = {rho:.2f} of a beauty sample ({scene['seconds_per_sample']:.2f} s).",
        "Loading the weights, apart: "
        + ", ".join(f"{n} {s:.2f} s" for n, s in scene["network_load_seconds"].items())
        + ".",
        *(
            f"Guides {kind}: {_changes(crossing[kind])}"
            for kind in ("rendered", "cached")
        ),
        f"Most of XRDS' seconds at that budget: {crossing['dearest_stage']}.",
    ]
    return "".join(f"<p>{html.escape(fact)}</p>" for fact in facts)


def _changes(changes: list[dict[str, Any]]) -> str:
    """The better method, from each budget on."""
    if not changes:
        return "no XRDS with weights."
    lines = [
        f"from {c['seconds']:.1f} s (budget {c['budget']:.2f}) "
        f"{'XRDS' if c['ours_better'] else 'the best OIDN mode'}"
        for c in changes
    ]
    return f"better is {', '.join(lines)}."


def _picker(report: Report) -> str:
    picker = report["picker"]
    if picker is None:
        return ""
    line = (
        f"Time budgets: {picker['within']:.0%} of {picker['runs']} whole frames took "
        f"{analysis.EARLIEST} to {analysis.LATEST} of the seconds asked for, the "
        f"latest {picker['latest']:.2f}."
    )
    if picker["alike"] is not None:
        line += (
            f" {picker['alike']:.0%} were within {analysis.ALIKE} dB of the best way "
            f"of the sweep, the worst {picker['farthest_behind']:.2f} dB below it."
        )
    rows = [
        [f"{row['budget']:g}", _gap(row["behind_best"]), _gap(row["behind_oidn"])]
        for row in picker["budgets"]
    ]
    head = ["budget", "dB below the sweep's best", "dB below the best OIDN mode"]
    return f"<p>{line}</p>{_rows(head, rows)}"


def _gap(gap: float | None) -> str:
    return "–" if gap is None else f"{gap:+.2f}"


def _machine(report: Report) -> str:
    rows = [[key, value] for key, value in report["machine"].items()]
    lacking = ", ".join(
        f"{preset} x{scale}" for preset, scale in report["settings"]["without_weights"]
    )
    rows.append(["without weights, so not measured", lacking or "none"])
    return f"<h2>Machine</h2>{_rows(['', ''], rows)}"


def _failures(report: Report) -> str:
    if not report["failures"]:
        return ""
    rows = [[name, error] for name, error in report["failures"].items()]
    return f"<h2>Left out</h2>{_rows(['what', 'why'], rows)}"


def _figure(svg: bytes) -> str:
    text = svg.decode("utf-8")
    return f"<figure>{text[text.index('<svg') :]}</figure>"
