"""The report: `results.json`, a page with tables, failures first, and plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing, write_json

from .bounds import bound

if TYPE_CHECKING:
    from pathlib import Path

    from .bounds import Check

# Curves that are plotted: name, title, label of x, logarithmic axes.
PLOTS = (
    ("firefly.far_change", "What fireflies change far away", "radiance", "xy"),
    ("constant.value", "Error of a constant picture", "albedo", ""),
    ("samples.falling_psnr", "PSNR against samples", "samples", "x"),
    ("shot.turntable.exposure", "Exposure over the turntable, stops", "frame", ""),
    ("load.memory", "Memory over 200 frames, KiB", "frame", ""),
    ("accumulation.long.memory", "Memory over a shot of 1000, KiB", "frame", ""),
)


def write(folder: Path, result: dict[str, Any], checks: list[Check]) -> None:
    """Write the report into an existing folder."""
    write_json(folder / "results.json", result)
    plots = _plots(folder, result["curves"])
    with replacing(folder / "report.md") as part:
        part.write_text(page(result, checks, plots))


def page(result: dict[str, Any], checks: list[Check], plots: list[str]) -> str:
    """Return the report as Markdown."""
    failures = [check for check in checks if not check.passed]
    bounded = [check for check in checks if check.bound is not None]
    lines = [
        "# Stability",
        "",
        f"{len(bounded)} values have a bound; {len(bounded) - len(failures)} hold it, "
        f"{sum(check.holds for check in failures)} have a measured exception, "
        f"{sum(not check.holds for check in failures)} fail. Written by `xrds "
        f"stability`: torch {result['machine']['torch']}, Blender "
        f"{result['machine']['blender']}, {result['machine']['device']}; weights "
        + ", ".join(f"{w['file']} ({w['sha256'][:8]})" for w in result["weights"])
        + ".",
        "",
        "## Failures",
        "",
        *_failures(failures),
        "",
        "## All values",
        "",
        *_table(checks),
        *(f"\n![{name}]({name})" for name in plots),
    ]
    return "\n".join(lines) + "\n"


def _failures(failures: list[Check]) -> list[str]:
    if not failures:
        return ["None."]
    ordered = sorted(failures, key=lambda check: (check.holds, check.name))
    return [
        "| value | weights | measured | bound | exception |",
        "|---|---|---|---|---|",
        *(
            f"| `{c.name}` | {c.preset} x{c.scale} {c.precision} | {c.value:.3g} "
            f"| {c.bound:g} | {c.exception or '**none**'} |"
            for c in ordered
        ),
    ]


def _table(checks: list[Check]) -> list[str]:
    subjects = list(
        dict.fromkeys(f"{c.preset} x{c.scale} {c.precision}" for c in checks)
    )
    values = {(c.name, f"{c.preset} x{c.scale} {c.precision}"): c for c in checks}
    lines = [
        "| value | bound | " + " | ".join(subjects) + " |",
        "|---|---|" + "---|" * len(subjects),
    ]
    for name in dict.fromkeys(c.name for c in checks):
        limit = bound(name).limit
        cells = [_cell(values.get((name, subject))) for subject in subjects]
        shown = "" if limit is None else f"{limit:g}"
        lines.append(f"| `{name}` | {shown} | " + " | ".join(cells) + " |")
    return lines


def _cell(check: Check | None) -> str:
    if check is None:
        return ""
    return f"{check.value:.3g}" if check.passed else f"**{check.value:.3g}**"


def _plots(folder: Path, curves: list[dict[str, Any]]) -> list[str]:
    """Draw the curves that were measured; return the names of the pictures."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    names = []
    for name, title, label, logarithmic in PLOTS:
        drawn = [c for c in curves if c["name"] == name]
        if not drawn:
            continue
        figure = Figure(figsize=(8, 4), layout="constrained")
        axes = figure.subplots()
        axes.set_prop_cycle(color=colormaps["tab20"].colors)  # every subject its own
        for curve in drawn:
            points = curve["points"]
            axes.plot(*zip(*points, strict=True), marker="o", label=curve["subject"])
        axes.set(title=title, xlabel=label)
        if "x" in logarithmic:
            axes.set_xscale("log")
        if "y" in logarithmic:
            axes.set_yscale("log")
        figure.legend(fontsize="small", loc="outside right upper")
        names.append(f"{name.replace('.', '_')}.png")
        figure.savefig(folder / names[-1], dpi=80)
    return names
