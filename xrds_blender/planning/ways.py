"""The ways to render a frame, what each needs, and what to expect of each.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from .budget import Choice, Curve, Model, Network
from .denoiser import DEFAULT_DENOISER, Denoiser


class Way(StrEnum):
    """How a frame is rendered, as the panel's first choice has it."""

    AUTOMATIC = "automatic"
    FULL_SIZE = "full_size"
    X2 = "x2"
    X4 = "x4"
    X8 = "x8"
    PLAIN = "plain"

    @property
    def scale(self) -> int:
        """Enlargement along each side."""
        return int(self.value[1:]) if self.is_enlarged else 1

    @property
    def is_enlarged(self) -> bool:
        """Whether a network makes the picture."""
        return self.value.startswith("x")

    @classmethod
    def of(cls, scale: int, plain: bool) -> Way:
        """The way of a job."""
        if plain:
            return cls.PLAIN
        return cls.FULL_SIZE if scale == 1 else cls(f"x{scale}")


WAYS = tuple(way for way in Way if way is not Way.AUTOMATIC)
"""In the order of the panel; of equally good ones the first is the best."""
# Differences in dB that nobody sees.
ALIKE = 0.1
LIBRARY_IS_MISSING = "Open Image Denoise is missing: install XRDS from its zip"
TORCH_IS_MISSING = (
    "Super-resolution needs PyTorch, which is not installed: see the add-on's "
    "preferences"
)
WEIGHTS_ARE_MISSING = "There are no weights for this network: choose another way"


@dataclass(frozen=True)
class Means:
    """What a render can use here."""

    denoiser: bool
    """XRDS' own."""
    cycles_denoiser: bool
    """That of Blender's build."""
    torch: bool
    networks: frozenset[Network] = frozenset()
    """Those whose weights are there."""

    @property
    def any_denoiser(self) -> bool:
        """Whether anything can denoise."""
        return self.denoiser or self.cycles_denoiser


@dataclass(frozen=True)
class Asked:
    """A scene's settings, as far as ways differ by them.

    `plain_denoiser` is Cycles' mode in a plain render, None where it does not denoise
    or does it in a way that was never measured.
    """

    samples: int
    denoise: str = "high"
    preset: str = "fast"
    guide_samples: int = 4
    plain_denoiser: Denoiser | None = DEFAULT_DENOISER

    def network(self, scale: int) -> Network:
        """The weights that an enlargement needs."""
        return Network(self.preset, scale)


@dataclass(frozen=True)
class Outlook:
    """What to expect of a way that can work here.

    `decibels` below the best, 0 for the best itself, `seconds` of a frame; None where
    nothing is known.
    """

    way: Way
    decibels: float | None = None
    seconds: float | None = None


def missing(way: Way, asked: Asked, means: Means) -> str:
    """The sentence that says what a way lacks here; empty if it can work."""
    if way is Way.FULL_SIZE:
        return "" if means.denoiser else LIBRARY_IS_MISSING
    if not way.is_enlarged:
        return ""
    if not means.torch:
        return TORCH_IS_MISSING
    return "" if asked.network(way.scale) in means.networks else WEIGHTS_ARE_MISSING


def choice_of(way: Way, asked: Asked) -> Choice | None:
    """The way at these settings; None for a plain render that does not denoise."""
    if way.is_enlarged:
        network = asked.network(way.scale)
        guides = {**network._asdict(), "guide_samples": asked.guide_samples}
        return Choice(DEFAULT_DENOISER, asked.samples, **guides)
    if way is Way.PLAIN:
        mode = asked.plain_denoiser
        return None if mode is None else Choice(mode, asked.samples)
    return Choice(Denoiser(f"XRDS-{asked.denoise.upper()}"), asked.samples)


def outlooks(
    asked: Asked,
    means: Means,
    model: Model,
    seconds: Callable[[Way, Asked], float | None] = lambda *_: None,
) -> list[Outlook]:
    """What to expect of each way that can work, in the order of WAYS."""
    ways = [way for way in WAYS if not missing(way, asked, means)]
    below = _decibels(
        {way: _curve(way, asked, means, model) for way in ways}, asked.samples
    )
    return [Outlook(way, below[way], seconds(way, asked)) for way in ways]


def best(looks: Sequence[Outlook]) -> Way:
    """The way with the least error expected; plain where nothing is known."""
    for look in looks:
        if look.decibels is not None and look.decibels >= -ALIKE:
            return look.way
    return Way.PLAIN


def _curve(way: Way, asked: Asked, means: Means, model: Model) -> Curve | None:
    """Expected PSNR over samples; None where none was measured."""
    if way.is_enlarged and not means.any_denoiser:
        return None  # measured with a denoised low-resolution picture
    wanted = choice_of(way, replace(asked, samples=0))
    if wanted is None:
        return None
    if not way.is_enlarged:
        return model.errors.curves.get(wanted)
    alike = {
        choice.guide_samples: curve
        for choice, curve in model.errors.curves.items()
        if replace(choice, guide_samples=asked.guide_samples) == wanted
    }
    enough = [n for n in alike if n <= asked.guide_samples]
    return alike[max(enough)] if enough else None


def _decibels(
    curves: Mapping[Way, Curve | None], samples: int
) -> dict[Way, float | None]:
    """How far below the best each way is.

    Two curves are compared at a count for which both were measured: beyond that
    neither says anything.
    """
    known = {way: curve for way, curve in curves.items() if curve is not None}
    found: dict[Way, float | None] = dict.fromkeys(curves)
    if not known:
        return found
    first = next(iter(known.values()))
    apart = {
        way: _difference(curve, first, samples)
        for way, curve in known.items()
        if samples >= curve.samples[0]
    }
    most = max(apart.values(), default=0.0)
    return found | {way: value - most for way, value in apart.items()}


def _difference(curve: Curve, other: Curve, samples: int) -> float:
    count = min(samples, curve.samples[-1], other.samples[-1])
    return curve.at(count) - other.at(count)
