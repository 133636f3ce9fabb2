"""The tables that pages hold, made of results."""

from __future__ import annotations

from operator import itemgetter
from statistics import mean, median
from typing import TYPE_CHECKING

from .results import SCENES, Results, only, scene_name

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .results import Rows

    Table = list[list[str]]

MOTIONS = ("pan", "objects", "both")
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
    for samples in (2, 16):
        usual = only(
            results.shots["shots"],
            motion="pan",
            samples=samples,
            method="cycles_oidn_default",
        )
        psnr = {x["scene"]: x["psnr"] for x in usual}
        cells = [psnr[x] for x in SCENES]
        table.append(
            [
                f"Cycles + OIDN, {samples} samples per frame",
                *(f"{x:.1f}" for x in [*cells, mean(cells)]),
            ]
        )
        gains = results.gains("pan", samples)
        cells = [gains[x] for x in SCENES]
        label = f"**XRDS, {samples} samples per frame: gain**"
        table.append([label, *(f"{x:+.1f}" for x in cells), f"**{mean(cells):+.1f}**"])
    return table


def shot_motions(results: Results) -> Table:
    """What shots gain under three motions, at 2 and 16 samples, by scene."""
    table = [["", *(scene_name(x) for x in SCENES), "mean"]]
    for motion in MOTIONS:
        few, many = (results.gains(motion, samples) for samples in (2, 16))
        means = [mean(gains[x] for x in SCENES) for gains in (few, many)]
        cells = [_two(few[x], many[x]) for x in SCENES]
        table.append([f"`{motion}`", *cells, _two(*means)])
    return table


def _two(few: float, many: float) -> str:
    return f"{few:+.1f}, {many:+.1f}"


def _signed(decibels: float) -> str:
    """Return a difference; what rounds to nothing is +0.00."""
    return f"{round(decibels, 2) + 0.0:+.2f}"


def shots_by_samples(results: Results) -> Table:
    """What shots bring over their frames alone, by samples."""
    head = ["samples", "scenes", "mean gain", "worst gain", "FLIP", "flicker"]
    table = [[*head, "worst flicker"]]
    for samples in sorted({x["samples"] for x in results.by_samples}):
        rows = only(results.by_samples, samples=samples)
        gains = [x["gain"] for x in rows]
        errors = mean(x["flip"] / x["flip_alone"] for x in rows)
        flicker = [x["flicker_along"] / x["flicker_along_alone"] for x in rows]
        cells = [samples, len(rows), f"{mean(gains):+.1f}", f"{min(gains):+.1f}"]
        cells += [f"{errors:.2f}", f"{mean(flicker):.2f}", f"{max(flicker):.2f}"]
        table.append(list(map(str, cells)))
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

    What a card rendered, only of scenes that the processor did not.
    """
    head = ["samples", "pictures", "scenes", "share of them", "seconds", "late"]
    table = [[*head, "PSNR", "worst", "FLIP", "flicker"]]
    case = itemgetter("scene", "samples", "noise_threshold")
    timed = {case(x) for x in only(results.same_picture, by="processor")}
    rows = [
        x
        for x in results.same_picture
        if x["by"] == "processor" or case(x) not in timed
    ]
    names = ("samples", "noise_threshold", "size", "by")
    for kind in dict.fromkeys(map(itemgetter(*names), rows)):
        file = dict(zip(names, kind, strict=True))
        ours = only(rows, method="same_picture", **file)
        cycles = only(rows, method="cycles_oidn", **file)
        alone = {x["scene"]: x for x in cycles}
        worst = min(ours, key=lambda x: float(x["gain"]))
        samples, threshold, size, by = kind
        label = "" if threshold is None else f", threshold {threshold:g}"
        table.append(
            [
                f"{samples}{label}",
                f"{size}, card" if by == "card" else size,
                str(len(ours)),
                f"{mean(x['late_share'] for x in ours):.2f}",
                *(_mean_if_timed(ours, name) for name in ("ratio", "late_ratio")),
                f"{mean(x['gain'] for x in ours):+.1f}",
                f"{worst['gain']:+.1f} {scene_name(worst['scene'])}",
                *(
                    f"{mean(x[name] / alone[x['scene']][name] for x in ours):.2f}"
                    for name in ("flip", "flicker")
                ),
            ]
        )
    return table


def _mean_if_timed(rows: Rows, name: str) -> str:
    """The mean of seconds; nothing where other work ran beside it."""
    if any(x[name] is None for x in rows):
        return "-"
    return f"{mean(x[name] for x in rows):.2f}"


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


TABLES: Mapping[str, Callable[[Results], Table]] = {
    "shots in short": shots_in_short,
    "shots by motion": shot_motions,
    "shots by samples": shots_by_samples,
    "gallery": gallery,
    "passes of light": light_parts,
    "same picture": same_picture,
    "stills": stills,
    "denoisers": denoisers,
    "low budgets": low_budgets,
    "card": card,
}
"""Tables by the name that a page's marker gives: `<!-- table: NAME -->`."""
