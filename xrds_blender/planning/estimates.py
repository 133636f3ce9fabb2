"""What each mode needs to render, and what to expect of it.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from xrds_core.accumulation.frame import bytes_needed

from . import shot_figures
from .budget import Costs, Curve, ErrorModel, Model
from .settings import (
    DEFAULT_DENOISING,
    MODES,
    Denoising,
    Mode,
    Network,
    Settings,
    low_size,
)

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
    gain: float = 0.0,
) -> list[Estimate]:
    """What to expect of each mode that can work, in the order of MODES.

    In a shot neighbouring frames `gain` so many decibels in each mode of ours.
    """
    in_mode = {m: resolved(replace(settings, mode=m), scene) for m in MODES}
    able = {mode: each for mode, each in in_mode.items() if not missing(each, here)}
    samples = settings.samples or scene.samples
    curves = {m: _curve(s, here, model.errors) for m, s in able.items()}
    gains = {m: 0.0 if m is Mode.CYCLES_ONLY else gain for m in able}
    below = _decibels(curves, samples, gains)
    return [Estimate(m, below[m], seconds(each)) for m, each in able.items()]


def automatic(has_denoiser: bool) -> Mode:
    """The mode that is taken where none is chosen: full size wherever it can work.

    That needs our denoiser. It is the best at any number of samples; what was measured
    says so.
    """
    return Mode.FULL_SIZE if has_denoiser else Mode.CYCLES_ONLY


def _curve(settings: Settings, here: Capabilities, errors: ErrorModel) -> Curve | None:
    """Expected PSNR over samples; None where none was measured."""
    wanted = settings.family
    if not wanted.is_enlarged:
        return errors.curves.get(wanted)
    if not here.any_denoiser:
        return None  # measured with a denoised low-resolution picture
    alike = {
        family.guide_samples: curve
        for family, curve in errors.curves.items()
        if family.mode is wanted.mode
        and family.preset == wanted.preset
        and family.denoising is DEFAULT_DENOISING
    }
    enough = [n for n in alike if n <= wanted.guide_samples]
    return alike[max(enough)] if enough else None


def _decibels(
    curves: Mapping[Mode, Curve | None], samples: int, gains: Mapping[Mode, float]
) -> dict[Mode, float | None]:
    """How far below the best each mode is, with what it gains in a shot.

    Two curves are compared at a count for which both were measured: beyond that
    neither says anything.
    """
    known = {mode: curve for mode, curve in curves.items() if curve is not None}
    below_best: dict[Mode, float | None] = dict.fromkeys(curves)
    if not known:
        return below_best
    first = next(iter(known.values()))
    apart = {
        mode: _difference(curve, first, samples) + gains[mode]
        for mode, curve in known.items()
        if samples >= curve.samples[0]
    }
    most = max(apart.values(), default=0.0)
    return below_best | {mode: value - most for mode, value in apart.items()}


def _difference(curve: Curve, other: Curve, samples: int) -> float:
    count = min(samples, curve.samples[-1], other.samples[-1])
    return curve.at(count) - other.at(count)


# A frame of more pixels than this many times those measured is not estimated: what a
# small one takes to begin would count too much.
MOST_GROWTH = 4
# A guide sample's seconds over a full one's, where no guides were rendered yet: 0.46 to
# 0.83 in the scenes of docs/results/bench.
GUIDE_SHARE = 0.65


@dataclass(frozen=True)
class Measured:
    """Seconds of a frame's parts, for the whole frame of `pixels` at full size.

    `fixed`: scene sync, BVH, writing and all else; `beauty` and `guide`: one sample;
    `denoise`: Blender's default denoiser; `networks`: each that has run; `reuse`: what
    neighbours took, which is accumulated and denoised again; `totals`: frames by
    themselves as they were. `share` is how much of the file's samples frames took in
    the last *Same Picture*. None is what no render has shown yet.
    """

    pixels: int
    fixed: float = 0.0
    beauty: float | None = None
    guide: float | None = None
    denoise: float | None = None
    networks: Mapping[Network, float] = field(default_factory=dict)
    reuse: float | None = None
    totals: Mapping[Settings, float] = field(default_factory=dict)
    share: float | None = None

    def seconds(
        self, settings: Settings, pixels: int, model: Model, radius: int = 0
    ) -> float | None:
        """Those that resolved settings will about take; `pixels` may be others.

        `radius` frames before and after are reused.
        """
        here = _resized(self, pixels)
        radius = 0 if settings.is_cycles_only else radius
        if not radius and settings in here.totals:
            return here.totals[settings]
        if here.beauty is None:
            return None
        if settings.denoising is None:
            assert settings.samples is not None
            return here.fixed + settings.samples * here.beauty
        costs = here.costs(pixels, model, radius)
        try:
            return None if costs is None else costs.seconds(_in_process(settings))
        except KeyError:  # a network of which nothing is known
            return None

    def costs(self, pixels: int, model: Model, radius: int = 0) -> Costs | None:
        """Costs of every choice at a number of pixels; None where too little is known.

        What has not run yet is taken from the model. `radius` as in `seconds`.
        """
        here = _resized(self, pixels)
        if here.beauty is None or here.denoise is None:
            return None
        denoise = {m: here.denoise * x for m, x in model.denoiser_speed.items()}
        networks = {n: here.denoise * x for n, x in model.network_speed.items()}
        return Costs(
            fixed=here.fixed + here._reusing(denoise[Denoising.XRDS_HIGH], radius),
            beauty=here.beauty,
            guide=GUIDE_SHARE * here.beauty if here.guide is None else here.guide,
            denoise=denoise,
            network={**networks, **here.networks},
        )

    def _reusing(self, denoise: float, radius: int) -> float:
        """Seconds that neighbours take; our denoiser takes `denoise`."""
        if not radius:
            return 0.0
        if self.reuse is not None:
            return self.reuse
        figures = shot_figures.shipped()
        return (2 * radius * figures.accumulate + figures.again) * denoise


def learn(
    known: Measured | None,
    settings: Settings,
    pixels: int,
    seconds: Mapping[str, float],
    model: Model,
    *,
    frame: int = 1,
    share: float | None = None,
) -> Measured:
    """What is known after one more render, of these seconds by stage.

    Its settings are resolved. A render at another size or in another mode adds to what
    is known from the ones before. It is the first `frame` of a job, or a later one:
    then what is known is the mean of them. `share` as in `Measured`.
    """
    seconds = defaultdict(float, seconds)
    before = _resized(known, pixels) if known else Measured(pixels)
    now = _learn_frame(before, settings, seconds, model)
    if share is not None:
        now = replace(now, share=share)
    if frame == 1:
        return now
    means: dict[str, Any] = {}
    for name in ("fixed", "beauty", "guide", "denoise", "reuse", "share"):
        old, new = getattr(before, name), getattr(now, name)
        if old is not None and new is not None:
            means[name] = old + (new - old) / frame
    return replace(now, **means)


_OF_NO_STAGE = {"total", "load"}  # nor is what is loaded loaded again


def _learn_frame(
    before: Measured, settings: Settings, seconds: Mapping[str, float], model: Model
) -> Measured:
    parts = sum(x for stage, x in seconds.items() if stage not in _OF_NO_STAGE)
    now = before
    if seconds["accumulate"]:
        # the frames ahead count in the total of the first one
        now = replace(before, reuse=seconds["accumulate"] + seconds["again"])
        fixed = seconds["sync"] + seconds["write"]
    else:
        whole = max(seconds["total"] - seconds["load"], parts)
        now = replace(before, totals={**before.totals, settings: whole})
        fixed = seconds["sync"] + seconds["write"] + whole - parts
    now = replace(now, fixed=fixed)
    assert settings.samples is not None
    sample = seconds["beauty"] / settings.samples
    if settings.is_enlarged:
        return _of_enlarged(now, settings, sample, seconds, model)
    if settings.denoising is None:
        return replace(now, beauty=sample)
    speed = model.denoiser_speed[settings.denoising]
    if settings.mode is Mode.FULL_SIZE:
        return replace(now, beauty=sample, denoise=seconds["denoise"] / speed)
    # Cycles reports its samples and its denoiser as one, so that must be known
    if now.denoise is None or now.denoise * speed >= seconds["beauty"]:
        return now
    return replace(now, beauty=sample - now.denoise * speed / settings.samples)


def _of_enlarged(
    now: Measured,
    settings: Settings,
    sample: float,
    seconds: Mapping[str, float],
    model: Model,
) -> Measured:
    area = settings.scale**2
    denoise = now.denoise
    if denoise is None and seconds["denoise"] and area <= MOST_GROWTH:
        speed = model.denoiser_speed[Denoising.XRDS_HIGH]
        denoise = seconds["denoise"] * area / speed
    return replace(
        now,
        beauty=sample * area,
        guide=seconds["guides"] / settings.guide_samples,
        denoise=denoise,
        networks={**now.networks, settings.network: seconds["network"]},
    )


def _resized(known: Measured, pixels: int) -> Measured:
    """The same for another number of pixels; nothing where that is far larger."""
    size = pixels / known.pixels
    if size > MOST_GROWTH:
        return Measured(pixels)

    def of(value: float | None) -> float | None:
        return None if value is None else value * size

    return Measured(
        pixels=pixels,
        fixed=known.fixed,
        beauty=of(known.beauty),
        guide=of(known.guide),
        denoise=of(known.denoise),
        reuse=of(known.reuse),
        share=known.share,
        networks={network: value * size for network, value in known.networks.items()},
        totals={key: value * size for key, value in known.totals.items()},
    )


def _in_process(settings: Settings) -> Settings:
    """With the denoiser that runs on the low-resolution picture: ours."""
    if settings.is_enlarged and settings.denoising is DEFAULT_DENOISING:
        return replace(settings, denoising=Denoising.XRDS_HIGH)
    return settings


# Bytes of tensors per output pixel of a tile, as the network measures itself when it
# runs, with what the allocator loses; the tests compare. Kept here because measuring
# needs torch, which a panel must not load.
NETWORK_BYTES = {
    ("fast", 2): 268,
    ("fast", 4): 238,
    ("fast", 8): 142,
    ("balanced", 2): 356,
    ("balanced", 4): 326,
    ("balanced", 8): 144,
    ("paper", 2): 1438,
    ("paper", 4): 553,
    ("paper", 8): 540,
}
OVERHEAD, TILE_BYTES = 2.0, 100.0
DEFAULT_LIMIT = 4 << 30
# Full-size float32 channels beside the network: picture, albedo, normal, alphas, the
# result and its copy.
PICTURE_CHANNELS = 24


# Channels of Cycles' passes that an animation keeps of each frame sampled ahead.
AHEAD_CHANNELS = 15


def memory(
    width: int, height: int, preset: str, scale: int, limit: int | None = None
) -> int:
    """Bytes that XRDS takes at the most beside Cycles; the network's come in tiles."""
    pixels = width * height
    network = pixels * (NETWORK_BYTES[preset, scale] * OVERHEAD + TILE_BYTES)
    pictures = pixels * PICTURE_CHANNELS * 4
    return int(pictures + min(network, limit or DEFAULT_LIMIT))


def shot_memory(width: int, height: int, radius: int, scale: int = 1) -> int:
    """Bytes that an animation's window of frames takes, of an ordinary scene.

    Without the user's own passes; `radius` frames to each side are stored.
    """
    if not radius:
        return 0
    frames = 2 * radius + 1
    low = low_size(width, height, scale)
    images = scale == 1
    window = bytes_needed(*low, frames, alpha=True, vector=True, images=images)
    if scale > 1:
        window += bytes_needed(
            width, height, frames, alpha=True, vector=True, light=False
        )
    return window + radius * width * height * AHEAD_CHANNELS * 4
