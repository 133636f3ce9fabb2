"""What each mode needs to render, and what to expect of it.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from .budget import Curve, ErrorModel, Model
from .settings import DEFAULT_DENOISING, MODES, Denoising, Mode, Network, Settings

LIBRARY_IS_MISSING = "Open Image Denoise is missing: install XRDS from its zip"
TORCH_IS_MISSING = (
    "Super-resolution needs PyTorch, which is not installed: see the add-on's "
    "preferences"
)
WEIGHTS_ARE_MISSING = "There are no weights for this network: choose another mode"


@dataclass(frozen=True)
class Capabilities:
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
class Estimate:
    """What to expect of a mode that can work here.

    `decibels` below the best, 0 for the best itself, `seconds` of a frame; None where
    nothing is known.
    """

    mode: Mode
    decibels: float | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class SceneSettings:
    """What a scene has where settings leave it open.

    `denoising` is that of Cycles alone, None where it does not denoise or in a mode
    that was never measured.
    """

    samples: int
    denoising: Denoising | None = DEFAULT_DENOISING


def resolved(settings: Settings, scene: SceneSettings) -> Settings:
    """The settings with nothing left open, and nothing that the mode does not use."""
    denoising = settings.denoising
    if settings.is_cycles_only:
        denoising = settings.cycles_denoising or scene.denoising
    elif settings.mode is Mode.FULL_SIZE:
        denoising = Denoising.ours(settings.quality)
    family = replace(settings, denoising=denoising).family
    return replace(family, samples=settings.count(scene.samples))


def missing(settings: Settings, here: Capabilities) -> str:
    """The sentence that says what is lacking here; empty if the settings can work."""
    if settings.mode is Mode.FULL_SIZE:
        return "" if here.denoiser else LIBRARY_IS_MISSING
    if not settings.is_enlarged:
        return ""
    if not here.torch:
        return TORCH_IS_MISSING
    return "" if settings.network in here.networks else WEIGHTS_ARE_MISSING


def estimates(
    settings: Settings,
    scene: SceneSettings,
    here: Capabilities,
    model: Model,
    seconds: Callable[[Settings], float | None] = lambda _: None,
    radius: int = 0,
) -> list[Estimate]:
    """What to expect of each mode that can work, in the order of MODES.

    `radius` frames to each side give a frame their samples.
    """
    in_mode = {m: resolved(replace(settings, mode=m), scene) for m in MODES}
    able = {mode: each for mode, each in in_mode.items() if not missing(each, here)}
    samples = settings.samples or scene.samples
    alone = model.errors
    errors = alone.in_shot(radius) if radius else alone
    curves = {
        m: _curve(s, here, alone if m is Mode.CYCLES_ONLY else errors)
        for m, s in able.items()
    }
    below = _decibels(curves, samples)
    return [Estimate(m, below[m], seconds(each)) for m, each in able.items()]


def automatic(here: Capabilities) -> Mode:
    """The mode that is taken where none is chosen: full size wherever it can work.

    It is the best at any number of samples; what was measured says so.
    """
    return Mode.FULL_SIZE if here.denoiser else Mode.CYCLES_ONLY


def _curve(settings: Settings, here: Capabilities, errors: ErrorModel) -> Curve | None:
    """Expected PSNR over samples; None where none was measured."""
    wanted = settings.family
    if not wanted.is_enlarged:
        return errors.curves.get(wanted)
    if not here.any_denoiser:
        return None  # measured with a denoised low-resolution picture
    wanted = replace(wanted, denoising=DEFAULT_DENOISING)
    alike = {
        family.guide_samples: curve
        for family, curve in errors.curves.items()
        if replace(family, guide_samples=wanted.guide_samples) == wanted
    }
    enough = [n for n in alike if n <= wanted.guide_samples]
    return alike[max(enough)] if enough else None


def _decibels(
    curves: Mapping[Mode, Curve | None], samples: int
) -> dict[Mode, float | None]:
    """How far below the best each mode is.

    Two curves are compared at a count for which both were measured: beyond that
    neither says anything.
    """
    known = {mode: curve for mode, curve in curves.items() if curve is not None}
    found: dict[Mode, float | None] = dict.fromkeys(curves)
    if not known:
        return found
    first = next(iter(known.values()))
    apart = {
        mode: _difference(curve, first, samples)
        for mode, curve in known.items()
        if samples >= curve.samples[0]
    }
    most = max(apart.values(), default=0.0)
    return found | {mode: value - most for mode, value in apart.items()}


def _difference(curve: Curve, other: Curve, samples: int) -> float:
    last = (each.samples[-1] / each.worth for each in (curve, other))
    count = min(samples, *last)
    return curve.at(count) - other.at(count)
