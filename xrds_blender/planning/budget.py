"""Seconds asked for -> what to render: the least error expected in them.

Seconds come from a cost model of the scene at hand (what the probes found), errors
from a table that `xrds bench` measured on other scenes. Pure functions: neither
Blender nor torch is needed here.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from .denoiser import Denoiser
from .plan import Decision

MODEL = Path(__file__).with_name("budget.json")
# Predictions scatter; a frame that is late is worse than one that is early.
AIM = 0.97
# Where nothing fits: what is as fast as the fastest, as far as predictions can tell.
ALIKE = 1.1
# What is no better than what was chosen may end this much late: a quicker denoiser
# saves little more time and costs decibels.
LATE = 0.05
MOST_SAMPLES = 16384
# Of a neighbour's samples in a shot: those that count like the frame's own, as Cycles +
# OIDN needs 4 to 5 times the samples for the same picture at a radius of 4.
LENT = 0.5
# Seconds that each neighbour takes, to be packed and accumulated, over those of the
# quickest denoising.
ACCUMULATION = 0.25


class Network(NamedTuple):
    """What a weights file is for."""

    preset: str
    scale: int


@dataclass(frozen=True)
class Choice:
    """What is rendered: scale 1 needs no network, only a denoiser, Cycles' or ours.

    `samples` are per low-resolution pixel, `guide_samples` per full one.
    """

    denoiser: Denoiser
    samples: int
    scale: int = 1
    preset: str = ""
    guide_samples: int = 0

    @property
    def network(self) -> Network:
        """The weights it needs."""
        return Network(self.preset, self.scale)

    @property
    def label(self) -> str:
        """In a few words, as the panel and the command print it."""
        samples = "1 sample" if self.samples == 1 else f"{self.samples} samples"
        if self.scale == 1 and self.denoiser.is_ours:
            return f"full size, {samples}, {self.denoiser.quality} denoising"
        if self.scale == 1:
            return f"plain, {samples}, OIDN {self.denoiser}"
        return (
            f"{self.preset} x{self.scale}, {samples}, "
            f"{self.guide_samples} guide samples, OIDN {self.denoiser}"
        )


@dataclass(frozen=True)
class Costs:
    """Seconds of one frame's parts, all for the whole frame at its full size.

    `fixed`: scene sync, BVH, reading and writing, whatever is rendered, and `probes`,
    what has gone into finding all this out; `beauty` and `guide`: one sample; `denoise`
    by denoiser; `network` by network; `pictures`: how many are denoised at full size.
    """

    fixed: float
    beauty: float
    guide: float
    denoise: Mapping[Denoiser, float]
    network: Mapping[Network, float]
    probes: float = 0.0
    pictures: int = 1

    def in_shot(self, radius: int) -> Costs:
        """Those of a frame to which `radius` frames before and after lend samples.

        The probes are the first frame's alone. At full size the frame is denoised by
        itself as well.
        """
        lending = 2 * radius * ACCUMULATION * min(self.denoise.values())
        return replace(
            self,
            fixed=self.fixed - self.probes + lending,
            probes=0.0,
            pictures=2 if radius else 1,
        )

    def seconds(self, choice: Choice) -> float:
        """Of the whole frame; raises KeyError for an unknown denoiser or network."""
        return self._without_samples(choice) + choice.samples * self._sample(choice)

    def samples(self, choice: Choice, seconds: float) -> int:
        """Most samples for which the choice keeps to `seconds`; 0 if none does."""
        left = seconds - self._without_samples(choice)
        return max(0, min(MOST_SAMPLES, math.floor(left / self._sample(choice))))

    def _sample(self, choice: Choice) -> float:
        return self.beauty / choice.scale**2

    def _without_samples(self, choice: Choice) -> float:
        denoise = self.denoise[choice.denoiser]
        if choice.scale == 1:
            return self.fixed + denoise * self.pictures
        guides = choice.guide_samples * self.guide
        low = self.fixed + denoise / choice.scale**2
        return low + guides + self.network[choice.network]


@dataclass(frozen=True)
class Curve:
    """PSNR in dB over sample counts, never falling; linear in log2 of the count.

    Beyond its last sample it is flat: what was not measured is not promised. Each
    sample counts as `worth` of those.
    """

    samples: tuple[int, ...]
    psnr: tuple[float, ...]
    worth: float = 1.0

    def at(self, count: int) -> float:
        """PSNR at a count of at least the first."""
        samples = count * self.worth
        after = bisect_right(self.samples, samples)
        if after in {0, len(self.samples)}:
            return self.psnr[max(after - 1, 0)]
        (low, high), (least, most) = (
            values[after - 1 : after + 1] for values in (self.samples, self.psnr)
        )
        share = math.log2(samples / low) / math.log2(high / low)
        return least + share * (most - least)

    @classmethod
    def of(cls, points: Mapping[int, float]) -> Curve:
        """Through measured points; where more samples are worse, the best so far."""
        counts = sorted(points)
        best = [max(points[n] for n in counts[: i + 1]) for i in range(len(counts))]
        return cls(tuple(counts), tuple(best))


@dataclass(frozen=True)
class ErrorModel:
    """Expected PSNR of every choice: one curve over samples for each of the others.

    The keys are choices with no samples.
    """

    curves: Mapping[Choice, Curve]

    def psnr(self, choice: Choice) -> float:
        """In dB; raises KeyError for what was not measured."""
        return self.curves[_without_count(choice)].at(choice.samples)

    def limited(self, denoisers: Collection[Denoiser]) -> ErrorModel:
        """Without those choices at scale 1 whose denoiser is not among these."""
        kept = {
            choice: curve
            for choice, curve in self.curves.items()
            if choice.scale > 1 or choice.denoiser in denoisers
        }
        return ErrorModel(kept)

    def in_shot(self, radius: int) -> ErrorModel:
        """Of frames to which `radius` frames before and after lend their samples."""
        worth = 1 + 2 * radius * LENT
        return ErrorModel(
            {choice: replace(c, worth=worth) for choice, c in self.curves.items()}
        )

    def families(self, networks: Sequence[Network]) -> Iterator[tuple[Choice, Curve]]:
        """Everything but the sample counts, of what these weights can render."""
        for choice, curve in self.curves.items():
            if choice.scale == 1 or choice.network in networks:
                yield choice, curve


@dataclass(frozen=True)
class Model:
    """What `xrds bench` has learnt about all scenes and all machines.

    `denoiser_speed` and `network_speed` are seconds at one size over those of
    DEFAULT_DENOISER, which a probe measures; `other_per_megapixel` seconds of reading,
    writing and all else.
    """

    errors: ErrorModel
    denoiser_speed: Mapping[Denoiser, float]
    network_speed: Mapping[Network, float]
    other_per_megapixel: float
    source: str = ""

    @classmethod
    def read(cls, path: Path = MODEL) -> Model:
        """From the file that `xrds bench --model` writes."""
        content = json.loads(path.read_text("utf-8"))
        curves = {
            _choice_of(entry["choice"]): Curve(
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
            {Denoiser(mode): x for mode, x in content["denoisers"].items()},
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
                    "choice": {k: v for k, v in vars(choice).items() if k != "samples"},
                    "samples": list(curve.samples),
                    "psnr": [round(value, 3) for value in curve.psnr],
                }
                for choice, curve in self.errors.curves.items()
            ],
        }


@dataclass(frozen=True)
class Picked:
    """The choice with what is expected of it, and the best of the other kind."""

    choice: Choice
    seconds: float
    psnr: float
    rival: Picked | None = None
    fits: bool = True

    def decision(self, goal: float, in_seconds: bool = True) -> Decision:
        """What was chosen and why, for the plan: `goal` in seconds or in dB."""
        name, unit = ("time budget", "s") if in_seconds else ("quality", "dB")
        reason = f"{self.psnr:.1f} dB expected in {self.seconds:.1f} s"
        if not self.fits and in_seconds:
            reason = f"{goal:g} s is too short for this scene; the nearest: {reason}"
        elif not self.fits:
            reason = f"{goal:g} dB is beyond what was measured; the best: {reason}"
        elif self.rival is None:
            reason += f", the only method for {goal:g} {unit}"
        else:
            other = self.rival
            reason += (
                f"; best {_kind(other.choice)} for {goal:g} {unit}: "
                f"{other.choice.label}: {other.psnr:.1f} dB in {other.seconds:.1f} s"
            )
        return Decision(name, self.choice.label, reason)


def choose(
    budget: float, costs: Costs, errors: ErrorModel, networks: Sequence[Network]
) -> Picked:
    """The least error expected within `budget` seconds; where none fits the fastest.

    Where super-resolution alone fits, but full size nearly does, the latter: it is
    decibels better. Of what is in time more seconds never give more expected error.
    """
    fitting = list(_fitting(budget * AIM, costs, errors, networks))
    if not fitting:
        return _fastest(costs, errors, networks)
    best = max(fitting, key=_merit)
    if best.choice.scale > 1:
        full_size = [p for p in _few(costs, errors, []) if p.seconds <= budget * ALIKE]
        late = max(full_size, key=_merit, default=best)
        if late.psnr > best.psnr:
            return replace(late, fits=False)
    rivals = [p for p in fitting if _kind(p.choice) != _kind(best.choice)]
    rival = max(rivals, key=_merit, default=None)
    return Picked(best.choice, best.seconds, best.psnr, rival)


def denoiser_in_time(
    spent: float, budget: float, choice: Choice, costs: Costs, errors: ErrorModel
) -> Denoiser:
    """Ours with the least error for the samples that are there after `spent` seconds.

    `choice` at scale 1 is what was chosen for the `budget`: samples may have taken more
    or less time than expected. Where nothing is in time, about the quickest.
    """
    psnr = {
        family.denoiser: curve.at(choice.samples)
        for family, curve in errors.families([])
        if family.denoiser.is_ours
    }
    late = budget * (1 + LATE)
    ends = {mode: spent + costs.denoise[mode] for mode in psnr}
    in_time = [
        mode
        for mode, end in ends.items()
        if end <= (budget if psnr[mode] > psnr[choice.denoiser] else late)
    ]
    quickest = min(ends.values())
    about = [mode for mode, end in ends.items() if end <= quickest * ALIKE]
    return max(in_time or about, key=lambda mode: psnr[mode])


def reach(
    psnr: float, costs: Costs, errors: ErrorModel, networks: Sequence[Network]
) -> Picked:
    """The fastest choice of at least `psnr` dB; the best there is where none has it."""
    picks = []
    for family, curve in errors.families(networks):
        samples = _least_samples(curve, psnr)
        picks.append(_picked(family, samples, costs, curve))
    enough = [p for p in picks if p.psnr >= psnr]
    if not enough:
        best = max(picks, key=_merit)
        return Picked(best.choice, best.seconds, best.psnr, None, fits=False)
    best = min(enough, key=lambda p: p.seconds)
    rivals = [p for p in enough if _kind(p.choice) != _kind(best.choice)]
    rival = min(rivals, key=lambda p: p.seconds, default=None)
    return Picked(best.choice, best.seconds, best.psnr, rival)


def _fitting(
    seconds: float, costs: Costs, errors: ErrorModel, networks: Sequence[Network]
) -> Iterator[Picked]:
    for family, curve in errors.families(networks):
        samples = costs.samples(family, seconds)
        if samples >= curve.samples[0]:
            yield _picked(family, samples, costs, curve)


def _fastest(costs: Costs, errors: ErrorModel, networks: Sequence[Network]) -> Picked:
    picks = _few(costs, errors, networks)
    least = min(p.seconds for p in picks)
    best = max((p for p in picks if p.seconds <= least * ALIKE), key=_merit)
    return Picked(best.choice, best.seconds, best.psnr, None, fits=False)


def _few(costs: Costs, errors: ErrorModel, networks: Sequence[Network]) -> list[Picked]:
    """Every family with the fewest samples that were measured."""
    return [
        _picked(family, curve.samples[0], costs, curve)
        for family, curve in errors.families(networks)
    ]


def _least_samples(curve: Curve, psnr: float) -> int:
    """Smallest count that reaches `psnr`; the largest measured where none does."""
    low, high = curve.samples[0], curve.samples[-1]
    while low < high:
        middle = (low + high) // 2
        if curve.at(middle) >= psnr:
            high = middle
        else:
            low = middle + 1
    return low


def _picked(family: Choice, samples: int, costs: Costs, curve: Curve) -> Picked:
    choice = _with_count(family, samples)
    return Picked(choice, costs.seconds(choice), curve.at(samples))


def _merit(picked: Picked) -> tuple[float, float]:
    """Least error first; of equals the faster."""
    return picked.psnr, -picked.seconds


def _kind(choice: Choice) -> str:
    if choice.scale > 1:
        return "super-resolution"
    return "full size" if choice.denoiser.is_ours else "plain"


def _choice_of(fields: Mapping[str, Any]) -> Choice:
    """A choice with no samples, from its entry in the model's file."""
    return Choice(samples=0, **{**fields, "denoiser": Denoiser(fields["denoiser"])})


def _with_count(family: Choice, samples: int) -> Choice:
    fields = vars(family) | {"samples": samples}
    return Choice(**fields)


def _without_count(choice: Choice) -> Choice:
    return _with_count(choice, 0)


@lru_cache(maxsize=1)
def shipped() -> Model:
    """The model that comes with XRDS."""
    return Model.read()
