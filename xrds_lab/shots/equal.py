"""Equal quality: the samples that Cycles + OIDN needs for the picture of a shot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.denoiser import DEFAULT_DENOISER

from ..bench.sweep import Config
from .figures import REACH, XRDS

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
        config = Config("oidn", samples, DEFAULT_DENOISER)
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


def targets(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The pictures that are compared: a panning camera, the standard radius."""
    wanted = {"motion": "pan", "method": XRDS, "radius": REACH}
    return [x for x in points if wanted.items() <= x.items()]
