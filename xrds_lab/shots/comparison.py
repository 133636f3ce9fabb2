"""Sections of the page that compare with Cycles + OIDN: how sure, by which measure."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from .frames import REACH
from .methods import DEFAULT, MEDIAN, NL_MEANS, XRDS
from .paired import LEVEL, MEASURES
from .verdicts import NAMES, sentence

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    Row = dict[str, Any]


def sections(results: Mapping[str, Any]) -> Iterator[str]:
    """The sections, as Markdown, of what `results.json` holds beside its points."""
    yield from _sureness(results["differences"])
    yield from _verdicts(results["verdicts"])
    yield from _equal_seconds(results["equal_seconds"])


def _sureness(differences: Sequence[Row]) -> Iterator[str]:
    shots: dict[tuple[str, int], dict[str, Row]] = {}
    for entry in differences:
        if (entry["method"], entry["radius"]) == (XRDS, REACH):
            shot = shots.setdefault((entry["motion"], entry["samples"]), {})
            shot[entry["measure"]] = entry
    if not shots:
        return
    yield "## How sure the differences are"
    yield (
        f"XRDS at radius {REACH} against Cycles + OIDN's default, scene by scene: the "
        f"mean difference, its {LEVEL} % interval in brackets, and the worst scene. "
        "PSNR's is in dB, others are ratios and their mean is geometric. Intervals are "
        "of a bootstrap over scenes, and over seeds where there are several: they tell "
        "of scenes like these alone, and of so few are rather too narrow. *Between "
        "seeds*: the standard deviation of one scene's difference in PSNR."
    )
    lines = [
        f"| camera, samples per frame | seeds | {' | '.join(MEASURES.values())} "
        "| between seeds |",
        "|---|---|" + "---|" * (len(MEASURES) + 1),
    ]
    for (motion, samples), found in shots.items():
        cells = [_difference(found.get(measure)) for measure in MEASURES]
        spread = found["psnr"]["between_seeds"]
        seeds = found["psnr"]["seeds"]
        cells = [f"{motion}, {samples}", str(seeds), *cells, _optional(spread)]
        lines.append(f"| {' | '.join(cells)} |")
    yield "\n".join(lines)


def _difference(entry: Row | None) -> str:
    if entry is None:
        return "-"
    form = "{:+.2f}" if entry["measure"] == "psnr" else "{:.2f}"
    mean, worst = form.format(entry["mean"]), form.format(entry["worst"])
    bounds = ""
    if entry["low"] is not None:
        bounds = f" ({form} to {form})".format(entry["low"], entry["high"])
    return f"{mean}{bounds}, {worst} {entry['worst_scene']}"


def _optional(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


# --- who wins -------------------------------------------------------------------------


def _verdicts(verdicts: Sequence[Row]) -> Iterator[str]:
    if not verdicts:
        return
    yield "## Whether the measures agree"
    yield (
        f"Whose error is smaller on the mean, XRDS' at radius {REACH} or that of "
        "Cycles + OIDN's default; and in which scenes a measure says otherwise."
    )
    yield "\n".join(f"- {sentence(verdict)}" for verdict in verdicts)


# --- equal seconds --------------------------------------------------------------------


def _equal_seconds(entries: Sequence[Row]) -> Iterator[str]:
    if all(entry["gain"] is None for entry in entries):
        return
    yield "## Equal seconds"
    yield (
        f"PSNR at the seconds per frame of one method, XRDS at radius {REACH} or "
        "Cycles + OIDN's default, and what the other has in as many: read from its own "
        "frontier over samples, straight lines over the logarithm of seconds. Nothing "
        "is extrapolated: only scenes where the other was timed on both sides count. "
        "A median of three denoised frames and non-local means of three noisy ones "
        "have Cycles + OIDN's samples; what they take themselves is not counted."
    )
    shots = dict.fromkeys((e["motion"], e["at"], e["samples"]) for e in entries)
    lines = []
    for motion, at, samples in shots:
        asked = {"motion": motion, "at": at, "samples": samples}
        here = [e for e in entries if asked.items() <= e.items()]
        lines.append(f"- {_told(here)}")
    yield "\n".join(lines)


def _told(entries: Sequence[Row]) -> str:
    """What two methods have in equal seconds, of the scenes of one shot."""
    first = entries[0]
    at, other = first["at"], DEFAULT if first["at"] == XRDS else XRDS
    known = [e for e in entries if e["gain"] is not None]
    of = f"`{first['motion']}`: at the seconds of {NAMES[at]} with {first['samples']} "
    if not known:
        return f"{of}samples, {NAMES[other]} was not timed on both sides."
    own, theirs = (statistics.fmean(e[x] for e in known) for x in (at, other))
    gain = statistics.fmean(e["gain"] for e in known)
    worst = min(known, key=lambda e: e["gain"])
    return (
        f"{of}samples ({own:.2f} dB), {NAMES[other]} has {theirs:.2f} dB: XRDS "
        f"{gain:+.2f}, worst {worst['gain']:+.2f} {worst['scene']} "
        f"({len(known)} of {len(entries)} scenes{_flicker(known)}){_peers(known)}."
    )


def _flicker(entries: Sequence[Row]) -> str:
    """The mean ratio of what flickers, where it is told."""
    ratios = [e["flicker"] for e in entries]
    if None in ratios:
        return ""
    return f"; flicker {statistics.fmean(ratios):.2f} of Cycles + OIDN's"


def _peers(entries: Sequence[Row]) -> str:
    """What others make of the same samples."""
    names = {MEDIAN: "a median of three", NL_MEANS: "non-local means"}
    told = [
        f"{name} {statistics.fmean(e['peers'][peer] for e in entries):.2f} dB"
        for peer, name in names.items()
        if all(peer in e.get("peers", {}) for e in entries)
    ]
    return f"; {', '.join(told)}" if told else ""
