"""What the report derives from points: frontiers, budgets, crossings, the model."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from xrds_blender.planning import budget
from xrds_blender.planning.budget import Curve
from xrds_blender.planning.settings import (
    DEFAULT_DENOISING,
    OUR_DENOISING,
    Denoising,
    Mode,
    Settings,
)

from . import pareto, same_picture
from .stages import PLAIN_FRAME, XRDS_FRAME, in_process_name
from .sweep import DENOISERS, Config, xrds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .measure import SceneBench

    Point = dict[str, Any]
    Report = dict[str, Any]

ALIKE = 0.1
"""Differences in dB that nobody sees."""
# A picker keeps its promise between these shares of the seconds asked for.
EARLIEST, LATEST = 0.8, 1.05
OURS, CACHED, RIVAL = "XRDS", pareto.CACHED, "OIDN, best mode"


def analysed(report: Report, budgets: Sequence[float]) -> Report:
    """The report with what its points tell: from the frontier to the picker."""
    by_scene = {
        scene["scene"]: [p for p in report["points"] if p["scene"] == scene["scene"]]
        for scene in report["scenes"]
        if "default_seconds" in scene
    }
    units = {s["scene"]: s.get("default_seconds") for s in report["scenes"]}
    entries = [
        entry
        for name, points in by_scene.items()
        for entry in _budgets(name, points, units[name], budgets, _picks(report, name))
    ]
    return report | {
        "frontier": {
            name: [p["label"] for p in pareto.frontier(points)]
            for name, points in by_scene.items()
        },
        "budgets": entries,
        "mean": _means(entries, budgets),
        "crossings": [
            _crossing(name, points, units[name]) for name, points in by_scene.items()
        ],
        "same_picture": same_picture.in_order(
            [
                entry
                for name, points in by_scene.items()
                for entry in same_picture.entries(name, points, units[name], budgets)
            ]
        ),
        "picker": _picker(entries),
    }


def _picks(report: Report, scene: str) -> dict[str, Any]:
    return next(
        (s.get("picks", {}) for s in report["scenes"] if s["scene"] == scene), {}
    )


def _budgets(
    scene: str,
    points: Sequence[Point],
    unit: float,
    budgets: Sequence[float],
    picks: dict[str, Any],
) -> list[dict[str, Any]]:
    """The best of each group at each budget, and what the picker took."""
    entries = []
    for multiple in budgets:
        best = {
            name: _short(pareto.best_within(members, multiple * unit))
            for name, members in pareto.groups(points).items()
        }
        entry = {"scene": scene, "budget": multiple, "seconds": multiple * unit}
        pick = picks.get(f"{multiple:g}")
        entries.append(entry | {"best": best, "picker": pick})
    return entries


def _short(point: Point | None) -> dict[str, Any] | None:
    """The figures of a point that tables show."""
    if point is None:
        return None
    measures = [key for key in point if key.startswith(("psnr", "relmse", "flip"))]
    return {
        "label": point["label"],
        "seconds": point["seconds"]["total"],
        **{key: point[key] for key in measures},
    }


def _means(
    entries: Sequence[dict[str, Any]], budgets: Sequence[float]
) -> list[dict[str, Any]]:
    """Mean PSNR and trimmed RelMSE by group at each budget, of scenes with one."""
    means = []
    for multiple in budgets:
        here = [e for e in entries if e["budget"] == multiple]
        names = dict.fromkeys(name for e in here for name in e["best"])
        groups = {name: _mean([e["best"].get(name) for e in here]) for name in names}
        picked = _mean([e["picker"] for e in here])
        means.append({"budget": multiple, "groups": groups, "picker": picked})
    return means


def _mean(rows: Sequence[dict[str, Any] | None]) -> dict[str, float] | None:
    known = [row for row in rows if row is not None]
    if not known:
        return None
    keys = ("psnr", "relmse_trimmed")
    return {key: statistics.fmean(row[key] for row in known) for key in keys} | {
        "scenes": len(known)
    }


def _crossing(scene: str, points: Sequence[Point], unit: float) -> dict[str, Any]:
    """Where XRDS and the best OIDN mode cross, with guides rendered and cached."""
    groups = pareto.groups(points)
    rivals = groups.get(RIVAL, [])
    entry: dict[str, Any] = {"scene": scene}
    for name, group in (("rendered", OURS), ("cached", CACHED)):
        ours = groups.get(group, [])
        changes = pareto.crossings(ours, rivals)
        for change in changes:
            change["budget"] = change["seconds"] / unit
        entry[name] = changes
    best = pareto.best_within(groups.get(OURS, []), unit)
    entry["dearest_stage"] = None if best is None else pareto.dearest_stage(best)
    return entry


def _picker(entries: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """How the picker kept to its budgets, and what its choices cost in error."""
    made = [e for e in entries if e["picker"]]
    if not made:
        return None
    ratios = [e["picker"]["seconds"]["total"] / e["seconds"] for e in made]
    gaps = [gap for e in made if (gap := _gap(e, None)) is not None]
    behind = [
        {
            "budget": multiple,
            "behind_best": _behind(made, multiple, None),
            "behind_oidn": _behind(made, multiple, RIVAL),
        }
        for multiple in dict.fromkeys(e["budget"] for e in made)
    ]
    return {
        "runs": len(made),
        "within": sum(EARLIEST <= ratio <= LATEST for ratio in ratios) / len(ratios),
        "latest": max(ratios),
        "ratios": ratios,
        "alike": _share_alike(gaps),
        "farthest_behind": max(gaps, default=None),
        "budgets": behind,
    }


def _share_alike(gaps: Sequence[float]) -> float | None:
    return sum(gap <= ALIKE for gap in gaps) / len(gaps) if gaps else None


def _behind(
    entries: Sequence[dict[str, Any]], multiple: float, group: str | None
) -> float | None:
    """Mean dB by which the picker is below a group's best, or the best of all."""
    gaps = [_gap(e, group) for e in entries if e["budget"] == multiple]
    known = [gap for gap in gaps if gap is not None]
    return statistics.fmean(known) if known else None


def _gap(entry: dict[str, Any], group: str | None) -> float | None:
    """Decibels of one frame below a group's best; None where none of it fits."""
    best = [
        point["psnr"]
        for name, point in entry["best"].items()
        if point is not None and name != CACHED and group in {None, name}
    ]
    return max(best) - entry["picker"]["psnr"] if best else None


# --- the picker's model ---------------------------------------------------------------


def fitted(scenes: Sequence[SceneBench], points: Sequence[Point]) -> budget.Model:
    """The picker's model from these scenes: mean error curves, relative speeds.

    A choice counts where every scene has it, so that all means are over the same
    scenes. Speeds stay the shipped model's where nothing was timed.
    """
    errors: dict[tuple[Settings, int], list[float]] = {}
    for point in points:
        if point["method"] in {"oidn", "full_size", "xrds"}:
            key = _family(point), point["settings"]["samples"]
            errors.setdefault(key, []).append(point["psnr"])
    curves: dict[Settings, dict[int, float]] = {}
    for (family, samples), psnr in errors.items():
        if len(psnr) == len(scenes):
            curves.setdefault(family, {})[samples] = statistics.fmean(psnr)
    model = budget.ErrorModel({c: Curve.of(points) for c, points in curves.items()})
    names = ", ".join(scene.name for scene in scenes)
    source = f"mean over {len(scenes)} scenes: {names}; weights: "
    return _speeds(scenes, model, source + _weights(scenes[0]))


def _family(point: Point) -> Settings:
    """The settings of a point, without its samples."""
    chosen = point["settings"]
    mode = Mode.CYCLES_ONLY if point["method"] == "oidn" else Mode.of(chosen["scale"])
    denoising, guides = Denoising(chosen["denoiser"]), chosen["guide_samples"]
    return Settings(mode, None, denoising, chosen["preset"], guides).family


def _weights(scene: SceneBench) -> str:
    """The networks, each with the first digits of its file's checksum."""
    chosen = scene.settings
    return ", ".join(
        f"{n.preset} x{n.scale} {chosen.networks.digest(n)}"
        for n in chosen.sweep.networks
    )


def _speeds(
    scenes: Sequence[SceneBench], errors: budget.ErrorModel, source: str
) -> budget.Model:
    timed = [s for s in scenes if s.times.count(XRDS_FRAME)]
    if not timed:
        old = budget.shipped()
        return budget.Model(
            errors,
            old.denoiser_speed,
            old.network_speed,
            old.other_per_megapixel,
            source,
        )
    denoisers = {mode: _ratio(timed, lambda s, m=mode: s.times.denoising(m))
                 for mode in DENOISERS}  # fmt: skip
    denoisers |= {mode: _ratio(timed, lambda s, m=mode: s.times.median(_ours(m)))
                  for mode in OUR_DENOISING}  # fmt: skip
    networks = {
        network: _ratio(
            timed, lambda s, n=network: s.times.median(in_process_name(xrds(n)))
        )
        for network in timed[0].settings.sweep.networks
    }
    other = statistics.median(
        s.times.median(name, "other") / s.megapixels
        for s in timed
        for name in (PLAIN_FRAME, XRDS_FRAME)
    )
    return budget.Model(errors, denoisers, networks, other, source)


def _ours(mode: Denoising) -> str:
    return in_process_name(Config("full_size", 1, mode))


def _ratio(scenes: Sequence[SceneBench], seconds: Any) -> float:
    """Median over scenes of the seconds, as a multiple of the default denoiser's."""
    unit = DEFAULT_DENOISING
    ratios = [seconds(s) / max(s.times.denoising(unit), 1e-6) for s in scenes]
    return round(statistics.median(ratios), 4)
