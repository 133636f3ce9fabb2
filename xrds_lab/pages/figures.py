"""The figures that sentences of the pages hold, by name."""

from __future__ import annotations

from statistics import mean, median
from typing import TYPE_CHECKING

from ..gallery.judge import keeps_rule
from ..shots.frames import REACH
from ..shots.methods import CYCLES, DEFAULT, SAME_SAMPLES, XRDS
from .results import LONG_SHOT, OLD_PATTERN, beside_cycles, only

if TYPE_CHECKING:
    from .results import Results

    Figures = dict[str, float]


def figures(results: Results) -> Figures:
    """Return every figure that docs/figures.toml may name."""
    return {
        **_shots(results),
        **_equal_seconds(results),
        **_same_picture(results),
        **_own_seconds(results),
        **_held_out(results),
        **_gallery(results),
        **_parts(results),
        **_stills(results),
        **_denoisers(results),
        **_low_budgets(results),
        **_networks(results),
        **_cards(results),
        **_installs(results),
    }


def _installs(results: Results) -> Figures:
    names = ("light", "network", "cuda")
    rows = dict(zip(names, results.installs, strict=True))
    sizes = {f"install.{k}.megabytes": x["megabytes"] for k, x in rows.items()}
    return sizes | {f"install.{k}.seconds": x["seconds"] for k, x in rows.items()}


def _shots(results: Results) -> Figures:
    """Of shots over Cycles + OIDN: decibels, and flicker taken away in percent."""
    found: Figures = {}
    for samples in results.pan_samples:
        rows = results.pans(samples)
        gains = [x["gain"] for x in rows]
        flicker = mean(x["flicker_ratio"] for x in rows)
        name = f"shots.{samples}"
        found |= {f"{name}.mean": mean(gains), f"{name}.worst": min(gains)}
        found[f"{name}.steadier"] = 100.0 * (1.0 - flicker)
    both = [results.both(samples) for samples in results.pan_samples]
    flickers = [mean(x["flicker_ratio"] for x in rows) for rows in both if rows]
    return found | {"both.steadiest": min(flickers), "both.unsteadiest": max(flickers)}


def _equal_seconds(results: Results) -> Figures:
    """Of shots in the seconds of Cycles + OIDN; what a frame takes beside one alone."""
    found: Figures = {}
    for of, known in (
        ("equal", results.equal_seconds),
        ("equal.all", results.equal_seconds_of_all),
    ):
        for samples in {x["samples"] for x in known}:
            rows = only(known, samples=samples)
            name = f"{of}.{samples}"
            found[f"{name}.scenes"] = len(rows)
            found[f"{name}.mean"] = mean(x["gain"] for x in rows)
            found[f"{name}.worst"] = min(x["gain"] for x in rows)
            steadier = 1.0 - mean(x["flicker"] for x in rows)
            found[f"{name}.steadier"] = 100.0 * steadier
    means = [found[f"equal.{samples}.mean"] for samples in (8, 16, 64)]
    found |= {"equal.least": min(means), "equal.most": max(means)}
    timed = [x for x in results.shots["shots"] if x["seconds_per_frame"]]
    ways = {"shot": (XRDS, REACH), "alone": (XRDS, 0), "cycles": (DEFAULT, 0)}
    for way, (method, radius) in ways.items():
        rows = only(timed, method=method, radius=radius, motion="pan", samples=16)
        found[f"frame.{way}"] = median(x["seconds_per_frame"] for x in rows)
    return found


def _same_picture(results: Results) -> Figures:
    """Per cent of Cycles' processor seconds that a long shot takes."""
    rows = only(results.same_picture, **LONG_SHOT)
    return {
        "same.scenes": len(rows),
        "same.seconds": 100.0 * mean(x["processor_ratio"] for x in rows),
    }


def _own_seconds(results: Results) -> Figures:
    """Seconds of finishing a 1080p frame on two cores: of a shot, and of one alone."""
    points = results.read("own-seconds/own-seconds.json")["points"]
    rows = only(points, samples=16, cores=2)
    return {
        f"own.{part}": only(rows, part=part)[0]["seconds"] for part in ("shot", "alone")
    }


def _held_out(results: Results) -> Figures:
    """Gains in dB over Cycles + OIDN."""
    found: Figures = {}
    for samples in sorted({x["samples"] for x in results.held_out}):
        rows = beside_cycles(only(results.held_out, samples=samples))
        gains = [x["gain"] for x in rows]
        name = f"held_out.{samples}"
        found |= {f"{name}.mean": mean(gains), f"{name}.worst": min(gains)}
        found[f"{name}.scenes"] = len(gains)
        steady = mean(x["flicker_ratio"] for x in rows)
        found[f"{name}.steadier"] = 100.0 * (1.0 - steady)
    return found


def _gallery(results: Results) -> Figures:
    rows = results.gallery
    later = [x for x in results.later_gallery if x["samples"] in (2, 4, 16)]
    flicker = [
        x["flicker"] for x in only(rows, half="judging") if x["flicker"] is not None
    ]
    shown = [x for x in only(rows, samples=4) if x.get("image_gain") is not None]
    glass = [x["image_gain"] for x in shown if x["shot"].startswith("glass_")]
    mirrors = [x["image_gain"] for x in shown if not x["shot"].startswith("glass_")]
    return {
        "mirrors.least": min(mirrors),
        "mirrors.most": max(mirrors),
        "glass.least": min(glass),
        "glass.most": max(glass),
        "gallery.shots": len({x["shot"] for x in rows}),
        "gallery.rows": len(rows),
        "gallery.kept": sum(x["passed"] for x in rows),
        "gallery.flicker": median(flicker),
        "gallery.later.rows": len(later),
        "gallery.later.kept": sum(
            keeps_rule(x["gain"], x["worst"], x["share"]) for x in later
        ),
    }


def _parts(results: Results) -> Figures:
    found: Figures = {}
    for of in ("lobes", "groups"):
        means = results.part_means(of, 4)
        found[f"parts.{of}.shot"] = means["shot"] - means["one_by_one"]
        found[f"parts.{of}.below"] = means["one_by_one"] - means["still"]
    return found


def _stills(results: Results) -> Figures:
    scenes = results.bench["scenes"]
    units = [x["default_seconds"] for x in scenes]
    shares = [x["rho"] for x in scenes]
    found = {
        "unit.least": min(units),
        "unit.second": sorted(units)[-2],
        "unit.most": max(units),
        "guide_share.least": min(shares),
        "guide_share.most": max(shares),
    }
    budgets = (1.0, 2.0, 4.0, 8.0)
    for budget in budgets:
        over = results.over_rival(budget)
        new = [gain for scene, gain in over.items() if scene not in OLD_PATTERN]
        rows = results.unit(budget)
        name = f"stills.{budget:g}"
        found |= {
            f"{name}.mean": mean(over.values()),
            f"{name}.worst": min(over.values()),
            f"{name}.new_pattern": mean(new),
            f"{name}.over_default": mean(x["xrds"] - x["default"] for x in rows),
        }
    of = {
        key: [found[f"stills.{x:g}.{key}"] for x in budgets]
        for key in ("mean", "worst", "new_pattern")
    }
    return {
        **found,
        "stills.least": min(of["mean"]),
        "stills.most": max(of["mean"]),
        "stills.below": -min(of["worst"]),
        "stills.new_pattern.least": min(of["new_pattern"]),
        "stills.new_pattern.most": max(of["new_pattern"]),
    }


def _denoisers(results: Results) -> Figures:
    def psnr(quality: str, samples: int, *, new: bool = False) -> float:
        rows = results.denoiser(quality, samples)
        skipped = OLD_PATTERN if new else ()
        return mean(x["psnr"] for x in rows if x["scene"] not in skipped)

    best = [psnr("XRDS-BEST", n) - psnr("XRDS-HIGH", n) for n in (2, 4, 8)]
    new = [
        psnr("HIGH-ACCURATE", n, new=True) - psnr("XRDS-HIGH", n, new=True)
        for n in (2, 4, 8)
    ]
    return {
        "best.least": min(best),
        "best.most": max(best),
        "high.below.least": min(new),
        "high.below.most": max(new),
    }


def _low_budgets(results: Results) -> Figures:
    gains = [x["gain"] for x in only(results.low_budgets, guides="rendered")]
    return {"rendered.least": min(gains), "rendered.most": max(gains)}


def _cards(results: Results) -> Figures:
    cycles, shots = (
        only(results.card_pans, method=method) for method in (CYCLES, SAME_SAMPLES)
    )
    found = {
        "cycles": [x["seconds"] for x in cycles],
        "shot": [x["seconds"] for x in shots],
        "gain": [x["gain"] for x in shots],
    }
    return {
        f"card.{name}.{which.__name__}": which(values)
        for name, values in found.items()
        for which in (min, max)
    }


def _networks(results: Results) -> Figures:
    methods = results.standard["mean"]["2"]["fast"]
    return {
        "rays.xrds": methods["xrds"]["psnr"],
        "rays.full_size": methods["oidn_equal_spp"]["psnr"],
    }
