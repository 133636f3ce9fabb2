"""Means, worst windows and the printed table of the standard measure."""

from __future__ import annotations

import statistics
from typing import Any

from xrds_blender.planning.settings import Network

Record = dict[str, Any]

# Method names as the JSON has them, and the headings of their columns.
COLUMNS = {
    "xrds": "xrds",
    "bicubic": "bicubic",
    "demodulated_bilinear": "demod.",
    "joint_bilateral": "joint b.",
    "regressed": "regressed",
    "oidn_equal_spp": "OIDN=spp",
}
FIGURES = ("psnr", "relmse", "relmse_trimmed", "flip")
_DIGITS = {"psnr": 2, "relmse": 4, "relmse_trimmed": 4, "flip": 4}


def case(network: Network) -> str:
    """A block of the table by name: x2 fast."""
    return f"x{network.scale} {network.preset}"


def gain(methods: dict[str, dict[str, Any]]) -> float | None:
    """PSNR (dB) of the product over the better of bicubic and demodulated."""
    if "xrds" not in methods:
        return None
    rivals = (methods[name]["psnr"] for name in ("bicubic", "demodulated_bilinear"))
    return methods["xrds"]["psnr"] - max(rivals)


def means(records: list[Record]) -> dict[str, dict[str, dict[str, Any]]]:
    """Mean figures over the scenes that have them: {scale: {preset: {method: ..}}}."""
    return _by_case(records, _mean_methods)


def worst(records: list[Record]) -> dict[str, dict[str, dict[str, Any]]]:
    """Mean and smallest gain, and its scene: {scale: {preset: {..}}}."""
    return _by_case([r for r in records if r["gain"] is not None], _worst_gain)


def line(record: Record) -> str:
    """One window's PSNR by method, as a line of progress."""
    figures = ", ".join(
        f"{COLUMNS[name]} {figure['psnr']:.2f}"
        for name, figure in record["methods"].items()
    )
    return f"{record['scene']} {_case(record)}: {figures} dB"


def text(report: dict[str, Any]) -> str:
    """The whole report as text: a block for every scale and preset."""
    blocks = [_block(block, report) for block in _cases(report["scenes"]).values()]
    return "\n\n".join(blocks)


def _block(records: list[Record], report: dict[str, Any]) -> str:
    scale, preset = _key(records[0])
    lines = [_row(f"{_case(records[0])}, dB", [*COLUMNS.values(), "gain", "floor"])]
    for record in records:
        figures = [record["methods"].get(name, {}).get("psnr") for name in COLUMNS]
        figures += [record["gain"], record["reference_psnr_floor"]]
        lines.append(_row(record["scene"], [_cell(x, 2) for x in figures]))
    mean = report["mean"][scale][preset]
    gains = report["worst"].get(scale, {}).get(preset)
    for figure in FIGURES:
        cells = [mean.get(name, {}).get(figure) for name in COLUMNS]
        cells += [gains["mean"]] if gains and figure == "psnr" else []
        shown = [_cell(x, _DIGITS[figure]) for x in cells]
        lines.append(_row(f"mean {figure}", shown))
    if gains:
        lines.append(f"worst gain {gains['gain']:+.2f} dB: {gains['scene']}")
    return "\n".join(lines)


def _row(title: str, cells: list[str]) -> str:
    return (f"{title:<22}" + "".join(f"{cell:>10}" for cell in cells)).rstrip()


def _cell(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _case(record: Record) -> str:
    return case(Network(record["preset"], record["scale"]))


def _key(record: Record) -> tuple[str, str]:
    """Scale and preset as keys of the JSON."""
    return str(record["scale"]), record["preset"]


def _cases(records: list[Record]) -> dict[tuple[str, str], list[Record]]:
    cases: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        cases.setdefault(_key(record), []).append(record)
    return cases


def _by_case(records: list[Record], summary: Any) -> dict[str, dict[str, Any]]:
    result: dict[str, dict[str, Any]] = {}
    for (scale, preset), case in _cases(records).items():
        result.setdefault(scale, {})[preset] = summary(case)
    return result


def _mean_methods(records: list[Record]) -> dict[str, dict[str, float]]:
    result: dict[str, dict[str, float]] = {}
    for name in COLUMNS:
        rows = [r["methods"][name] for r in records if name in r["methods"]]
        if rows:
            figures = {
                key: statistics.fmean(row[key] for row in rows) for key in FIGURES
            }
            result[name] = {"windows": len(rows)} | figures
    return result


def _worst_gain(records: list[Record]) -> dict[str, Any]:
    lowest = min(records, key=lambda record: record["gain"])
    return {
        "mean": statistics.fmean(record["gain"] for record in records),
        "gain": lowest["gain"],
        "scene": lowest["scene"],
    }
