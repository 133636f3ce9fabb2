"""The tables that pages hold, made of results."""

from __future__ import annotations

from operator import itemgetter
from statistics import mean, median
from typing import TYPE_CHECKING

from ..shots.frames import REACH
from ..shots.methods import (
    BEST,
    CYCLES,
    DEFAULT,
    MEDIAN,
    NL_MEANS,
    SAME_PICTURE,
    XRDS,
)
from .results import (
    LONG_SHOT,
    SAME_CASE,
    SCENES,
    Results,
    beside_cycles,
    only,
    scene_name,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .results import Rows

    Table = list[list[str]]

UNITS = (1.0, 2.0, 4.0, 8.0)
QUALITIES = (
    "HIGH-ACCURATE",
    "XRDS-BEST",
    "XRDS-HIGH",
    "XRDS-MEDIUM",
    "HIGH-FAST",
    "XRDS-BALANCED",
    "FAST-FAST",
    "XRDS-FAST",
)


def shots_in_short(results: Results) -> Table:
    """Shots of the seven scenes: Cycles + OIDN, and what XRDS gains."""
    names = [scene_name(x) for x in SCENES]
    table = [["", *names, "mean"]]
    for samples in (2, 16, 64):
        usual = results.pans(samples, DEFAULT)
        psnr = {x["scene"]: x["psnr"] for x in usual}
        cells = [psnr[x] for x in SCENES]
        label = f"Cycles + OIDN, {samples} samples per frame"
        table.append([label, *(f"{x:.1f}" for x in [*cells, mean(cells)])])
        gains = {x["scene"]: x["gain"] for x in results.pans(samples)}
        cells = [gains[x] for x in SCENES]
        label = f"**XRDS, {samples} samples per frame: gain**"
        table.append([label, *(f"{x:+.1f}" for x in cells), f"**{mean(cells):+.1f}**"])
    return table


def _signed(decibels: float) -> str:
    """Return a difference; what rounds to nothing is +0.00."""
    return f"{round(decibels, 2) + 0.0:+.2f}"


def _least_gain(rows: Rows) -> str:
    """The smallest gain in dB, and its scene."""
    least = min(rows, key=lambda x: float(x["gain"]))
    return f"{least['gain']:+.1f} {scene_name(least['scene'])}"


def _most_flicker(rows: Rows, name: str) -> str:
    """The largest ratio of flicker, and its scene."""
    most = max(rows, key=lambda x: float(x[name]))
    return f"{most[name]:.2f} {scene_name(most['scene'])}"


def shots_by_samples(results: Results) -> Table:
    """What shots bring over Cycles + OIDN, by samples; `both` over the frame alone."""
    head = ["samples", "scenes", "mean gain", "worst gain", "FLIP", "flicker"]
    table = [[*head, "worst flicker", "`both`: gain", "worst"]]
    for samples in results.pan_samples:
        rows = results.pans(samples)
        gains = [x["gain"] for x in rows]
        flicker = [x["flicker_ratio"] for x in rows]
        both = [x["gain_over_alone"] for x in results.both(samples)]
        cells = [samples, len(rows), f"{mean(gains):+.1f}", f"{min(gains):+.1f}"]
        cells += [f"{mean(x['flip_ratio'] for x in rows):.2f}"]
        cells += [f"{mean(flicker):.2f}", f"{max(flicker):.2f}"]
        cells += [f"{mean(both):+.1f}", f"{min(both):+.1f}"] if both else ["-", "-"]
        table.append(list(map(str, cells)))
    return table


def peers(results: Results) -> Table:
    """PSNR and flicker of the same samples by other ways to steady pictures."""
    ways = {
        "Cycles + OIDN": (DEFAULT, 0),
        "its best mode": (BEST, 0),
        "median of three": (MEDIAN, 0),
        "non-local means": (NL_MEANS, 0),
        "XRDS, frame alone": (XRDS, 0),
        "XRDS, shot": (XRDS, REACH),
    }
    table = [["samples", *ways]]
    for samples in results.pan_samples:
        cells = [str(samples)]
        for method, radius in ways.values():
            rows = results.pans(samples, method, radius)
            flicker = mean(x["flicker_ratio"] for x in rows)
            cells.append(f"{mean(x['psnr'] for x in rows):.1f}, {flicker:.2f}")
        table.append(cells)
    return table


def equal_seconds(results: Results) -> Table:
    """A shot in the seconds of Cycles + OIDN; of some scenes in larger frames, too."""
    head = ["seconds of Cycles + OIDN with", "scenes", "gain", "worst", "flicker"]
    head += ["worst", "median of three: gain", "non-local means"]
    table = [[*head, "1920x1080: scenes", "gain", "flicker"]]
    for samples in sorted({x["samples"] for x in results.equal_seconds_of_all}):
        rows = only(results.equal_seconds_of_all, samples=samples)
        large = only(results.equal_seconds, samples=samples)
        table.append(
            [
                f"{samples} samples",
                *_gain(rows),
                _least_gain(rows),
                *_flicker(rows),
                _most_flicker(rows, "flicker"),
                *(
                    f"{mean(x['peers'][way] - x[DEFAULT] for x in rows):+.1f}"
                    for way in (MEDIAN, NL_MEANS)
                ),
                *(_gain(large) + _flicker(large) if large else ["-"] * 3),
            ]
        )
    return table


def _gain(rows: Rows) -> list[str]:
    return [str(len(rows)), f"{mean(x['gain'] for x in rows):+.1f}"]


def _flicker(rows: Rows) -> list[str]:
    return [f"{mean(x['flicker'] for x in rows):.2f}"]


def held_out(results: Results) -> Table:
    """Shots on which no constant was chosen, over Cycles + OIDN's samples."""
    head = ["samples", "scenes", "mean gain", "worst gain", "FLIP", "flicker"]
    table = [[*head, "worst flicker", "median of three: gain, flicker"]]
    for samples in sorted({x["samples"] for x in results.held_out}):
        here = only(results.held_out, samples=samples)
        rows, medians = beside_cycles(here), beside_cycles(here, MEDIAN)
        cells = [str(samples), str(len(rows)), f"{mean(x['gain'] for x in rows):+.1f}"]
        cells += [_least_gain(rows)]
        for name in ("flip_ratio", "flicker_ratio"):
            cells.append(f"{mean(x[name] for x in rows):.2f}")
        cells += [_most_flicker(rows, "flicker_ratio")]
        gain = mean(x["gain"] for x in medians)
        cells += [f"{gain:+.1f}, {mean(x['flicker_ratio'] for x in medians):.2f}"]
        table.append(cells)
    return table


def gallery(results: Results) -> Table:
    """Gain, worst block and broken rules of the gallery."""
    counts = (2, 4, 16)
    table = [["", *(f"{x} samples" for x in counts)]]
    for half in ("choosing", "judging"):
        cells = []
        for samples in counts:
            rows = only(results.gallery, half=half, samples=samples)
            gain = mean(x["gain"] for x in rows)
            worst = min(x["worst_block"] for x in rows)
            broken = sum(not x["passed"] for x in rows)
            cells.append(f"{gain:+.1f}; {worst:+.1f}; {broken} of {len(rows)}")
        table.append([half, *cells])
    return table


def light_parts(results: Results) -> Table:
    """Parts of the light: as rendered, one by one, as a still, in a shot."""
    table = [["4 samples", "as rendered", "one by one", "XRDS, still", "XRDS, shot"]]
    for of, label in (("lobes", "lobes"), ("groups", "light groups")):
        means = results.part_means(of, 4)
        table.append([label, *(f"{x:.1f}" for x in means.values())])
    return table


def same_picture(results: Results) -> Table:
    """Seconds and errors of *Same Picture* as ratios to Cycles + OIDN's.

    Held-out scenes are those that move as their files say.
    """
    head = ["samples", "pictures", "frames", "scenes"]
    head += ["share of them", "seconds", "late"]
    table = [[*head, "PSNR", "worst", "FLIP", "flicker"]]
    rows = results.same_picture
    names = SAME_CASE[1:]
    kinds = dict.fromkeys(map(itemgetter(*names), only(rows, method=SAME_PICTURE)))
    for kind in kinds:
        file = dict(zip(names, kind, strict=True))
        ours = only(rows, method=SAME_PICTURE, **file)
        cycles = only(rows, method=CYCLES, **file)
        alone = {x["scene"]: x for x in cycles}
        motion, samples, threshold, frames, size = kind
        label = "" if threshold is None else f", threshold {threshold:g}"
        held = ", held out" if motion == "file" else ""
        table.append(
            [
                f"{samples}{label}",
                size,
                str(frames),
                f"{len(ours)}{held}",
                *(
                    _mean_of(ours, name)
                    for name in ("late_share", "processor_ratio", "late_ratio")
                ),
                f"{mean(x['gain'] for x in ours):+.1f}",
                _least_gain(ours),
                *(
                    f"{mean(x[name] / alone[x['scene']][name] for x in ours):.2f}"
                    for name in ("flip", "flicker")
                ),
            ]
        )
    return table


def _mean_of(rows: Rows, name: str) -> str:
    """The mean of what was measured."""
    known = [x[name] for x in rows if x[name] is not None]
    return f"{mean(known):.2f}" if known else "-"


def stills(results: Results) -> Table:
    """The best picture within a budget."""
    table = [
        [
            "units",
            "Blender's default",
            "best mode of Cycles + OIDN",
            "XRDS",
            "XRDS over the best mode: mean, worst scene",
        ]
    ]
    for units in UNITS:
        groups = only(results.bench["mean"], budget=units)[0]["groups"]
        shown = [
            f"{groups[x]['psnr']:.2f}"
            for x in ("OIDN, default", "OIDN, best mode", "XRDS")
        ]
        over = results.over_rival(units)
        worst = min(over, key=lambda x: over[x])
        change = f"{_signed(mean(over.values()))}, {_signed(over[worst])}"
        table.append([f"{units:g}", *shown, f"{change} {scene_name(worst)}"])
    return table


def denoisers(results: Results) -> Table:
    """Errors and seconds of the denoiser's qualities and of Cycles' modes."""
    table = [["", "1 spp", "2", "4", "8", "seconds", "of the default's"]]
    times = results.bench["scenes"]
    for quality in QUALITIES:
        cells = [
            f"{mean(x['psnr'] for x in results.denoiser(quality, n)):.2f}"
            for n in (1, 2, 4, 8)
        ]
        if quality.startswith("XRDS-"):
            points = results.denoiser(quality, 1)
            seconds = {x["scene"]: x["seconds"]["denoise"] for x in points}
        else:
            seconds = {x["scene"]: x["denoise_seconds"][quality] for x in times}
        ratio = median(
            seconds[x["scene"]] / x["denoise_seconds"]["HIGH-ACCURATE"] for x in times
        )
        name = quality.removeprefix("XRDS-")
        label = f"`{name if name == quality else name.lower()}`"
        table.append([label, *cells, f"{median(seconds.values()):.1f}", f"{ratio:.2f}"])
    return table


def low_budgets(results: Results) -> Table:
    """Super-resolution with kept guides against a lowered resolution percentage."""
    table = [
        [
            "samples per pixel",
            "lowered resolution",
            "XRDS",
            "gain: mean, worst",
            "full size fits as well",
        ]
    ]
    for x in only(results.low_budgets, guides="kept"):
        worst = f"{x['worst']['gain']:+.2f} {scene_name(x['worst']['scene'])}"
        table.append(
            [
                f"{x['samples']:g}",
                f"{x['lowered']:.2f}",
                f"{x['xrds']:.2f}",
                f"{x['gain']:+.2f}, {worst}",
                f"{x['full_size_fits']} of {len(x['scenes'])}",
            ]
        )
    return table


def card(results: Results) -> Table:
    """Seconds on a card and on the cores beside it."""
    found = results.card
    table = [["1920 x 1080", "card", f"{found['machine']['cores']} cores"]]
    high = only(found["denoiser"], size=[1920, 1080])
    seconds = {x["device"]: median(x["seconds"]) for x in high}
    cells = [f"{seconds[x]:.2f}" for x in ("cuda", "cpu")]
    table.append(["denoiser, `high`", *cells])
    for scale in (2, 4):
        rows = only(found["network"], scale=scale, size=[1920, 1080])
        seconds = {x["device"]: x["seconds"] for x in rows}
        on_card, on_cores = seconds[found["machine"]["card"]], seconds["cpu"]
        table.append([f"network `fast` x{scale}", f"{on_card:.2f}", f"{on_cores:.2f}"])
    return table


def left_out(results: Results) -> Table:
    """What is left out of each scene: of an animation, a still, an enlarged picture."""
    head = ["", "animation: samples left out", "its seconds saved"]
    table = [[*head, "still: seconds of denoising", "super-resolution: seconds saved"]]
    times = {x["scene"]: x["denoise_seconds"] for x in results.bench["scenes"]}
    ours = {x["scene"]: x["seconds"] for x in results.denoiser("XRDS-HIGH", 1)}
    enlarged = {x["scene"]: x for x in results.left_out}
    for scene in SCENES:
        shot = only(results.same_picture, scene=scene, **LONG_SHOT)
        cells = ["-", "-"]
        if shot:
            left = 1.0 - shot[0]["mean_share"], 1.0 - shot[0]["processor_ratio"]
            cells = [f"{x:.0%}" for x in left]
        usual, own = times[scene]["HIGH-ACCURATE"], ours[scene]["denoise"]
        cells.append(f"{usual:.1f} -> {own:.1f}")
        x = enlarged[scene]
        before, after = x["seconds_all"], x["seconds_planned"]
        cells.append(f"{before:.1f} -> {after:.1f}, {x['saved']:.0%}")
        table.append([scene_name(scene), *cells])
    return table


TABLES: Mapping[str, Callable[[Results], Table]] = {
    "shots in short": shots_in_short,
    "shots by samples": shots_by_samples,
    "peers": peers,
    "equal seconds": equal_seconds,
    "held out": held_out,
    "gallery": gallery,
    "passes of light": light_parts,
    "same picture": same_picture,
    "left out": left_out,
    "stills": stills,
    "denoisers": denoisers,
    "low budgets": low_budgets,
    "card": card,
}
"""Tables by the name that a page's marker gives: `<!-- table: NAME -->`."""
