"""Paired differences to Cycles + OIDN: means, the worst scene, and how sure they are.

A difference is of the same scene, shot, samples and seed. PSNR's is in dB; other errors
are compared by their ratio, whose mean is geometric, below 1 where a method is better.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .methods import DEFAULT

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from xrds_core.arrays import Array

    Point = dict[str, Any]
    Difference = dict[str, Any]

MEASURES = {
    "psnr": "PSNR",
    "flip": "FLIP",
    "relmse_trimmed": "RelMSE",
    "flicker": "flicker",
}
ROUNDS = 10_000
LEVEL = 95
"""Per cent of the resampled means that an interval holds."""
_SEED = 7


def differences(points: Iterable[Point]) -> list[Difference]:
    """How each method compares with Cycles + OIDN, of each shot and measure.

    `scenes` holds the difference of each scene, its mean over seeds; `mean`, `worst`
    and `worst_scene` are of these; `low` and `high` bound the mean by a bootstrap over
    scenes, and over seeds where there are several (None of a single scene).
    `between_seeds` is the standard deviation of one scene's difference between seeds,
    of a ratio that of its logarithm, root mean square over scenes; None with one seed.
    """
    found = []
    for case, own in _methods(points).items():
        motion, samples, method, radius = case
        for measure in MEASURES:
            scenes = _by_scene(own, measure)
            if scenes:
                what = {"motion": motion, "samples": samples, "method": method}
                what |= {"radius": radius, "measure": measure}
                found.append(what | _summary(scenes, measure))
    return found


def _methods(
    points: Iterable[Point],
) -> dict[tuple[Any, ...], list[tuple[Point, Point]]]:
    """Points of each motion, samples, method and radius, beside the rival's."""
    points = list(points)
    rivals = {_shot(p): p for p in points if p["method"] == DEFAULT}
    found: dict[tuple[Any, ...], list[tuple[Point, Point]]] = {}
    for p in points:
        if p["method"] != DEFAULT and _shot(p) in rivals:
            case = p["motion"], p["samples"], p["method"], p["radius"]
            found.setdefault(case, []).append((p, rivals[_shot(p)]))
    return found


def _shot(point: Point) -> tuple[Any, ...]:
    seed = point.get("seed", 0)
    return point["scene"], point["motion"], point["samples"], seed


def _by_scene(
    pairs: Sequence[tuple[Point, Point]], measure: str
) -> dict[str, list[float]]:
    """Differences of each scene, one for each seed: dB, or logarithms of a ratio.

    There is none of errors that the noise of references hides: they may be negative.
    """
    scenes: dict[str, list[float]] = {}
    for own, rival in pairs:
        ours, theirs = own[measure], rival[measure]
        if measure == "psnr":
            scenes.setdefault(own["scene"], []).append(ours - theirs)
        elif ours and theirs and min(ours, theirs) > 0.0:
            scenes.setdefault(own["scene"], []).append(math.log(ours / theirs))
    return scenes


def _summary(scenes: Mapping[str, Sequence[float]], measure: str) -> Difference:
    means = {scene: float(np.mean(values)) for scene, values in scenes.items()}
    low, high = interval(list(scenes.values()))
    worst = (min if measure == "psnr" else max)(means, key=lambda scene: means[scene])
    values = {
        "mean": float(np.mean(list(means.values()))),
        "low": low,
        "high": high,
        "worst": means[worst],
    }
    spread = [np.var(x, ddof=1) for x in scenes.values() if len(x) > 1]
    return {
        **{name: _shown(value, measure) for name, value in values.items()},
        "worst_scene": worst,
        "scenes": {scene: _shown(value, measure) for scene, value in means.items()},
        "seeds": max(len(x) for x in scenes.values()),
        "between_seeds": _rounded(np.sqrt(np.mean(spread))) if spread else None,
    }


def _shown(value: float | None, measure: str) -> float | None:
    """A difference in dB, or a ratio of what is kept as its logarithm."""
    if value is None:
        return None
    return _rounded(value if measure == "psnr" else math.exp(value))


def _rounded(value: float) -> float:
    return round(float(value), 5)


def interval(scenes: Sequence[Sequence[float]]) -> tuple[float | None, float | None]:
    """Bounds of the mean over scenes of the means over seeds, by a bootstrap.

    Scenes are drawn with replacement, and of each drawn scene its seeds. The same
    values give the same bounds. None of fewer than two scenes, which tell nothing of
    others.
    """
    if len(scenes) < 2:
        return None, None
    rng = np.random.default_rng(_SEED)
    drawn = rng.integers(len(scenes), size=(ROUNDS, len(scenes)))
    means = np.empty(drawn.shape)
    for number, values in enumerate(scenes):
        here = drawn == number
        means[here] = _resampled(rng, np.asarray(values), int(here.sum()))
    edge = (100 - LEVEL) / 2
    low, high = np.percentile(means.mean(axis=1), (edge, 100 - edge))
    return float(low), float(high)


def _resampled(rng: np.random.Generator, values: Array, count: int) -> Array:
    """Means (count,) of values drawn with replacement, as many as there are."""
    if len(values) == 1:
        return np.repeat(values, count)
    return values[rng.integers(len(values), size=(count, len(values)))].mean(axis=1)
