"""What an animation takes in Cycles, and what XRDS makes of the same samples or time.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from xrds_core.pace.savings import LEAST
from xrds_core.progress import duration

from .budget import Curve
from .plan import DEADLINE
from .shot_figures import ShotFigures

_SAME = 0.05  # of seconds and flicker: what is nearer than this is the same
_SEEN = 0.3  # dB that can be seen


class Kind(StrEnum):
    """What is kept of Cycles' animation: its picture, its time, or its samples."""

    PICTURE = "same_picture"
    TIME = DEADLINE
    SAMPLES = "same_time"


@dataclass(frozen=True)
class Offer:
    """An animation by XRDS.

    `seconds` of all frames, None where nothing is known yet; `samples` of a frame;
    `decibels` beside Cycles' picture; `flicker` as a ratio to Cycles'. `is_measured`
    where its samples are from renders of this file, not those of other scenes.
    """

    kind: Kind
    seconds: float | None
    samples: float
    decibels: float
    flicker: float
    is_measured: bool = False


@dataclass(frozen=True)
class Animation:
    """An animation as the file has it.

    `samples` of a frame are the most where it `has_threshold`; `cycles` are the seconds
    of a frame in Cycles, and in XRDS it takes `fixed` seconds and so many for each
    `sample`: None where nothing is known. `radius` frames before and after are reused;
    0 where they cannot be. `obstacle` says why *Same Picture* is not possible, and
    `share` how much of the samples it took here. It `is_noisy` where Cycles does not
    denoise it. `measuring` *Same Picture* takes the samples of so many frames.
    """

    frames: int
    samples: int
    cycles: float | None = None
    fixed: float | None = None
    sample: float = 0.0
    radius: int = 0
    is_still: bool = False
    has_threshold: bool = False
    is_noisy: bool = False
    obstacle: str = ""
    share: float | None = None
    measuring: float = 0.0

    def seconds(self, samples: float) -> float | None:
        """Of all frames in XRDS."""
        if self.fixed is None:
            return None
        return self.frames * (self.fixed + samples * self.sample)


@dataclass(frozen=True)
class Offers:
    """An animation, its seconds in Cycles, and what XRDS offers: the best first."""

    animation: Animation
    cycles: float | None
    offers: tuple[Offer, ...]


def offers(animation: Animation, curve: Curve, figures: ShotFigures) -> Offers:
    """What to choose from; `curve` is the PSNR of frames by themselves over samples."""
    cycles = animation.cycles and animation.cycles * animation.frames
    if not animation.radius:
        return Offers(animation, cycles, ())
    same = None if animation.obstacle else _same_picture(animation, figures)
    if same and same.seconds and cycles and same.seconds > (1.0 - LEAST) * cycles:
        same = None
    in_time = _in_time(animation, curve, figures)
    found = same, in_time or _same_samples(animation, figures)
    return Offers(animation, cycles, tuple(x for x in found if x))


def _same_picture(animation: Animation, figures: ShotFigures) -> Offer:
    share = animation.share
    if share is None:
        of_samples = figures.share.at(animation.samples)
        share = figures.threshold_share if animation.has_threshold else of_samples
    samples = share * animation.samples
    seconds = animation.seconds(samples)
    if seconds is not None:
        seconds += animation.measuring * animation.samples * animation.sample
    is_measured = animation.share is not None
    flicker = figures.of_camera(animation.is_still).same_flicker
    return Offer(Kind.PICTURE, seconds, samples, 0.0, flicker, is_measured)


def _in_time(animation: Animation, curve: Curve, figures: ShotFigures) -> Offer | None:
    """The samples that fit into Cycles' seconds; None where they are no gain.

    Nor under a noise threshold: what its samples are is not known.
    """
    cycles, fixed, sample = animation.cycles, animation.fixed, animation.sample
    if cycles is None or fixed is None or not sample or animation.has_threshold:
        return None
    samples = (cycles - fixed) / sample
    if samples < 1.0:
        return None
    alone = _decibels(curve, samples) - _decibels(curve, animation.samples)
    radius, is_still = animation.radius, animation.is_still
    decibels = alone + figures.gain(samples, radius, is_still)
    # of frames by themselves flicker goes with the error
    error = 10.0 ** (-alone / 20.0)
    flicker = error * figures.flicker(samples, radius, is_still)
    seconds = cycles * animation.frames
    offer = Offer(Kind.TIME, seconds, samples, decibels, flicker)
    return offer if decibels >= _SEEN else None


def _same_samples(animation: Animation, figures: ShotFigures) -> Offer:
    samples, radius, is_still = animation.samples, animation.radius, animation.is_still
    return Offer(
        Kind.SAMPLES,
        animation.seconds(samples),
        samples,
        figures.gain(samples, radius, is_still),
        figures.flicker(samples, radius, is_still),
    )


def _decibels(curve: Curve, samples: float) -> float:
    """PSNR; beyond the last count it rises as in the last doubling."""
    last = curve.samples[-1]
    beyond = max(math.log2(samples / last), 0.0)
    return curve.at(min(samples, last)) + beyond * curve.last_slope


class Say(Protocol):
    """Puts values into a sentence, and may translate it before."""

    def __call__(self, sentence: str, /, **values: object) -> str: ...


def in_english(sentence: str, /, **values: object) -> str:
    """The sentence as it is."""
    return sentence.format(**values)


_OFFERS = {
    Kind.PICTURE: "The same picture: {time}{samples}{flicker}",
    Kind.TIME: "The same time, cleaner: {decibels:+.1f} dB{samples}{flicker}",
    Kind.SAMPLES: "The same samples: {time}, {decibels:+.1f} dB{flicker}",
}
_UNTIMED = {
    Kind.PICTURE: "The same picture{samples}{flicker}",
    Kind.SAMPLES: "The same samples: {decibels:+.1f} dB{flicker}",
}


def cycles_line(found: Offers, say: Say = in_english) -> str:
    """What the animation takes in Cycles, in a sentence."""
    frames = found.animation.frames
    if found.cycles is None:
        return say(
            "This animation, {frames} frames: one frame (F12) tells its time",
            frames=frames,
        )
    sentence = "This animation in Cycles, {frames} frames: {time}"
    if found.animation.is_noisy:
        sentence = "This animation in Cycles, not denoised, {frames} frames: {time}"
    return say(sentence, frames=frames, time=duration(found.cycles))


def offer_line(offer: Offer, animation: Animation, say: Say = in_english) -> str:
    """An offer in a sentence."""
    samples = ""
    if not animation.has_threshold:
        count = max(round(offer.samples), 1)
        sentence = ", {count} samples a frame" if count > 1 else ", 1 sample a frame"
        samples = say(sentence, count=count)
    flicker = ""
    if offer.flicker <= 1.0 - _SAME:
        less = round(100.0 * (1.0 - offer.flicker))
        flicker = say(", {less} % less flicker", less=less)
    known = offer.seconds is not None
    return say(
        (_OFFERS if known else _UNTIMED)[offer.kind],
        time=duration(offer.seconds or 0.0),
        samples=samples,
        decibels=offer.decibels,
        flicker=flicker,
    )


NOTHING_SAVED = "XRDS saves no time here: less noise and flicker is what it gains"
NOTHING_GAINED = "Frames of this animation cannot use each other's samples"
EXPECTED = "Samples, decibels and flicker are means over other scenes"
MEASURED = "Samples were measured in this file; flicker is a mean over other scenes"


def source_line(found: Offers, say: Say = in_english) -> str:
    """Where the figures are from, or that there is nothing to gain."""
    if not found.offers:
        return say(NOTHING_GAINED)
    first = found.offers[0]
    if first.kind is Kind.SAMPLES and first.seconds is not None:
        return say(NOTHING_SAVED)
    return say(MEASURED if first.is_measured else EXPECTED)
