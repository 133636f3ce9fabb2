"""Equal quality: the samples that Cycles + OIDN needs for the picture of a shot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import DEFAULT_DENOISING

from ..bench.same_picture import in_order
from ..bench.sweep import Config
from .figures import DEFAULT, REACH, XRDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..bench.journal import Journal
    from ..bench.pictures import Pictures

SERIES = (1, 2, 4, 8, 16, 32, 64, 128)


def curve(pictures: Pictures, journal: Journal, target: float) -> dict[int, float]:
    """PSNR of Cycles + OIDN by samples per pixel, as far as the first above `target`.

    Renders what the folder lacks.
    """
    known: dict[int, float] = {}
    for samples in SERIES:
        config = Config("oidn", samples, DEFAULT_DENOISING)
        pictures.render(pictures.missing([config]), journal, lambda _: None)
        with journal.attempt(f"{pictures.shot.name}: {config.label}"):
            known[samples] = pictures.errors(config)["psnr"]
        if known.get(samples, -math.inf) >= target:
            break
    pictures.save()
    return known


def samples_for(psnr: float, known: Mapping[int, float]) -> float | None:
    """The samples at which a curve reaches `psnr`; None where it does not.

    Straight between points over the logarithm of the samples. A picture worse than
    that of the fewest samples gets these.
    """
    before: tuple[int, float] | None = None
    for samples, value in sorted(known.items()):
        if value >= psnr:
            if before is None or value == before[1]:
                return float(samples)
            share = (psnr - before[1]) / (value - before[1])
            low, high = math.log2(before[0]), math.log2(samples)
            return float(2 ** (low + share * (high - low)))
        before = samples, value
    return None


def comparisons(
    points: Sequence[dict[str, Any]], known: Mapping[int, float]
) -> list[dict[str, Any]]:
    """What each of our pictures under a panning camera equals, of one scene."""
    return [
        {
            "scene": point["scene"],
            "motion": point["motion"],
            "samples": point["samples"],
            "radius": point["radius"],
            "psnr": point["psnr"],
            "cycles_samples": samples_for(point["psnr"], known),
            "curve": {str(samples): value for samples, value in known.items()},
        }
        for point in targets(points)
    ]


def with_seconds(
    entries: Sequence[dict[str, Any]], points: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """The comparisons with the seconds per frame of both, where both were timed.

    The slowest of XRDS first. Cycles' time is linear in its samples: two numbers of
    them tell that of any other.
    """
    found = []
    for entry in entries:
        case = {key: entry[key] for key in ("scene", "motion")}
        here = [p for p in points if case.items() <= p.items()]
        own = next((p for p in targets(here) if p["samples"] == entry["samples"]), None)
        rivals = {
            p["samples"]: p["seconds_per_frame"]
            for p in here
            if p["method"] == DEFAULT and p["seconds_per_frame"]
        }
        seconds = own and own["seconds_per_frame"]
        needed = seconds_for(entry["cycles_samples"], rivals)
        gain = needed / seconds if needed and seconds else None
        timed = {"seconds": seconds, "cycles_seconds": needed, "gain": gain}
        found.append(dict(entry) | timed)
    return in_order(found)


def seconds_for(samples: float | None, known: Mapping[int, float]) -> float | None:
    """Seconds of a frame by the line through those of the fewest and most samples."""
    if samples is None or len(known) < 2:
        return None
    few, many = min(known), max(known)
    slope = (known[many] - known[few]) / (many - few)
    return known[few] + max(slope, 0.0) * (samples - few)


def targets(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The pictures that are compared: a panning camera, the standard radius."""
    wanted = {"motion": "pan", "method": XRDS, "radius": REACH}
    return [x for x in points if wanted.items() <= x.items()]
