"""What fits into the seconds of a still: the least error expected in them.

Seconds come from a cost model of the scene at hand (what the probes found), errors
from a table that `xrds bench stills` measured on other scenes. Pure functions: neither
Blender nor torch is needed here.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from .plan import Decision
from .settings import Denoising, Mode, Network, Settings, counted

MODEL = Path(__file__).with_name("budget.json")
# Predictions scatter; a frame that is late is worse than one that is early.
AIM = 0.97
# Where nothing fits: what is as fast as the fastest, for all that predictions show.
ALIKE = 1.1
# What is no better than what was chosen may end this much late: a quicker denoiser
# saves little more time and costs decibels.
LATE = 0.05
MOST_SAMPLES = 16384


@dataclass(frozen=True)
class Costs:
    """Seconds of one frame's parts, all for the whole frame at its full size.

    `fixed`: scene sync, BVH, reading and writing, whatever is rendered, and in a shot
    what neighbours take; `beauty` and `guide`: one sample; `denoise` by denoiser;
    `network` by network.
    """

    fixed: float
    beauty: float
    guide: float
    denoise: Mapping[Denoising, float]
    network: Mapping[Network, float]

    def seconds(self, settings: Settings) -> float:
        """Of the whole frame; raises KeyError for an unknown denoiser or network."""
        assert settings.samples is not None
        rest = self._without_samples(settings)
        return rest + settings.samples * self._sample(settings)

    def samples(self, settings: Settings, seconds: float) -> int:
        """Most samples for which settings stay within `seconds`; 0 if none does."""
        left = seconds - self._without_samples(settings)
        return max(0, min(MOST_SAMPLES, math.floor(left / self._sample(settings))))

    def _sample(self, settings: Settings) -> float:
        return self.beauty / settings.scale**2

    def _without_samples(self, settings: Settings) -> float:
        denoising = settings.denoising
        denoise = 0.0 if denoising is None else self.denoise[denoising]
        if not settings.is_enlarged:
            return self.fixed + denoise
        seconds = self.fixed + denoise / settings.scale**2
        guides = settings.guide_samples * self.guide
        return seconds + guides + self.network[settings.network]


def value_at(count: float, counts: Sequence[int], values: Sequence[float]) -> float:
    """The value at a count above 0: linear in log2 of it, flat beyond both ends."""
    after = bisect_right(counts, count)
    if after in {0, len(counts)}:
        return values[max(after - 1, 0)]
    (low, high), (first, last) = (x[after - 1 : after + 1] for x in (counts, values))
    return first + math.log2(count / low) / math.log2(high / low) * (last - first)


@dataclass(frozen=True)
class Curve:
    """PSNR in dB over sample counts, never falling; linear in log2 of the count.

    Beyond its last sample it is flat: what was not measured is not promised.
    """

    samples: tuple[int, ...]
    psnr: tuple[float, ...]

    def at(self, count: float) -> float:
        """PSNR at a count of at least the first."""
        return value_at(count, self.samples, self.psnr)

    @property
    def last_slope(self) -> float:
        """Decibels of the last doubling that was measured."""
        (low, high), (least, most) = self.samples[-2:], self.psnr[-2:]
        return (most - least) / math.log2(high / low)

    @classmethod
    def of(cls, points: Mapping[int, float]) -> Curve:
        """Through measured points; where more samples are worse, the best so far."""
        counts = sorted(points)
        best = [max(points[n] for n in counts[: i + 1]) for i in range(len(counts))]
        return cls(tuple(counts), tuple(best))


@dataclass(frozen=True)
class ErrorModel:
    """Expected PSNR of every choice: one curve over samples for each family.

    The keys are settings as `Settings.family` has them.
    """

    curves: Mapping[Settings, Curve]

    def psnr(self, settings: Settings) -> float:
        """In dB; raises KeyError for what was not measured."""
        assert settings.samples is not None
        return self.curves[settings.family].at(settings.samples)

    @property
    def full_size(self) -> dict[Denoising, Curve]:
        """Curves over the samples of full size, by our denoiser."""
        return {
            family.denoising: curve
            for family, curve in self.curves.items()
            if family.mode is Mode.FULL_SIZE and family.denoising is not None
        }


@dataclass(frozen=True)
class Model:
    """What `xrds bench stills` has learnt about all scenes and all machines.

    `denoiser_speed` and `network_speed` are seconds at one size over those of
    DEFAULT_DENOISING, which a probe measures; `other_per_megapixel` seconds of reading,
    writing and all else.
    """

    errors: ErrorModel
    denoiser_speed: Mapping[Denoising, float]
    network_speed: Mapping[Network, float]
    other_per_megapixel: float
    source: str = ""

    @classmethod
    def read(cls, path: Path = MODEL) -> Model:
        """From the file that `xrds bench stills --model` writes."""
        content = json.loads(path.read_text("utf-8"))
        curves = {
            _family(entry["settings"]): Curve(
                tuple(entry["samples"]), tuple(entry["psnr"])
            )
            for entry in content["curves"]
        }
        networks = {
            Network(entry["preset"], entry["scale"]): entry["speed"]
            for entry in content["networks"]
        }
        return cls(
            ErrorModel(curves),
            {Denoising(each): x for each, x in content["denoisers"].items()},
            networks,
            content["other_per_megapixel"],
            content["source"],
        )

    def to_json(self) -> dict[str, Any]:
        """What `read` reads."""
        return {
            "source": self.source,
            "other_per_megapixel": self.other_per_megapixel,
            "denoisers": dict(self.denoiser_speed),
            "networks": [
                {"preset": preset, "scale": scale, "speed": speed}
                for (preset, scale), speed in self.network_speed.items()
            ],
            "curves": [
                {
                    "settings": {name: getattr(family, name) for name in _FAMILY},
                    "samples": list(curve.samples),
                    "psnr": [round(value, 3) for value in curve.psnr],
                }
                for family, curve in self.errors.curves.items()
            ],
        }


@dataclass(frozen=True)
class Selection:
    """Samples and our denoiser for a still, and what is expected of them."""

    samples: int
    denoising: Denoising
    seconds: float
    psnr: float
    fits: bool = True

    def decision(self, budget: float) -> Decision:
        """What was chosen for a budget in seconds and why, for the plan."""
        reason = f"{self.psnr:.1f} dB expected in {self.seconds:.1f} s"
        if not self.fits:
            reason = f"{budget:g} s is too short for this scene; the nearest: {reason}"
        value = f"{counted(self.samples, 'sample')}, {self.denoising.quality}"
        return Decision("time budget", value, reason)


def choose(budget: float, costs: Costs, errors: ErrorModel) -> Selection:
    """The least error expected within `budget` seconds; where none fits the fastest.

    More seconds never give more expected error.
    """
    fitting = []
    for denoising, curve in errors.full_size.items():
        samples = costs.samples(_settings(denoising), budget * AIM)
        if samples >= curve.samples[0]:
            fitting.append(_selection(denoising, samples, costs, curve))
    if fitting:
        return max(fitting, key=_merit)
    fewest = [
        _selection(denoising, curve.samples[0], costs, curve)
        for denoising, curve in errors.full_size.items()
    ]
    least = min(x.seconds for x in fewest)
    best = max((x for x in fewest if x.seconds <= least * ALIKE), key=_merit)
    return replace(best, fits=False)


def denoiser_in_time(
    spent: float, budget: float, foreseen: Selection, costs: Costs, errors: ErrorModel
) -> Denoising:
    """Ours with the least error for the samples that are there after `spent` seconds.

    `foreseen` was chosen for the `budget`: samples may have taken more or less time
    than expected. Where nothing is in time, about the quickest.
    """
    psnr = {x: curve.at(foreseen.samples) for x, curve in errors.full_size.items()}
    late = budget * (1 + LATE)
    ends = {denoising: spent + costs.denoise[denoising] for denoising in psnr}
    in_time = [
        denoising
        for denoising, end in ends.items()
        if end <= (budget if psnr[denoising] > psnr[foreseen.denoising] else late)
    ]
    quickest = min(ends.values())
    about = [x for x, end in ends.items() if end <= quickest * ALIKE]
    return max(in_time or about, key=lambda denoising: psnr[denoising])


def _settings(denoising: Denoising, samples: int | None = None) -> Settings:
    return Settings(Mode.FULL_SIZE, samples, denoising)


def _selection(
    denoising: Denoising, samples: int, costs: Costs, curve: Curve
) -> Selection:
    seconds = costs.seconds(_settings(denoising, samples))
    return Selection(samples, denoising, seconds, curve.at(samples))


def _merit(selected: Selection) -> tuple[float, float]:
    """Least error first; of equals the faster."""
    return selected.psnr, -selected.seconds


_FAMILY = ("mode", "denoising", "preset", "guide_samples")


def _family(fields: Mapping[str, Any]) -> Settings:
    """Settings without samples, from their entry in the model's file."""
    mode, denoising = Mode(fields["mode"]), Denoising(fields["denoising"])
    return Settings(mode, None, denoising, fields["preset"], fields["guide_samples"])


@lru_cache(maxsize=1)
def shipped() -> Model:
    """The model that comes with XRDS."""
    return Model.read()
