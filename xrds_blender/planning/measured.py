"""The next render's seconds, estimated from those that are finished.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from .budget import Costs, Model
from .settings import DEFAULT_DENOISING, Denoising, Mode, Network, Settings

# A frame of more pixels than this many times those measured is not estimated: what a
# small one takes to begin would count too much.
MOST_GROWTH = 4
# A guide sample's seconds over a full one's, where no guides were rendered yet: 0.46 to
# 0.83 in the scenes of docs/results/bench.
GUIDE_SHARE = 0.65


@dataclass(frozen=True)
class Measured:
    """Seconds of a frame's parts, for the whole frame of `pixels` at full size.

    `fixed`: scene sync, BVH and writing; `beauty` and `guide`: one sample; `denoise`:
    Blender's default denoiser; `networks`: each that has run; `totals`: renders as they
    were. None is what no render has shown yet.
    """

    pixels: int
    fixed: float = 0.0
    beauty: float | None = None
    guide: float | None = None
    denoise: float | None = None
    networks: Mapping[Network, float] = field(default_factory=dict)
    totals: Mapping[Settings, float] = field(default_factory=dict)

    def seconds(self, settings: Settings, pixels: int, model: Model) -> float | None:
        """Those that resolved settings will about take; `pixels` may be others."""
        here = _resized(self, pixels)
        if settings in here.totals:
            return here.totals[settings]
        if here.beauty is None:
            return None
        if settings.denoising is None:
            assert settings.samples is not None
            return here.fixed + settings.samples * here.beauty
        costs = here.costs(pixels, model)
        try:
            return None if costs is None else costs.seconds(_in_process(settings))
        except KeyError:  # a network of which nothing is known
            return None

    def costs(self, pixels: int, model: Model) -> Costs | None:
        """Costs of every choice at a number of pixels; None where too little is known.

        What has not run yet is taken from the model.
        """
        here = _resized(self, pixels)
        if here.beauty is None or here.denoise is None:
            return None
        networks = {n: here.denoise * x for n, x in model.network_speed.items()}
        return Costs(
            fixed=here.fixed,
            beauty=here.beauty,
            guide=GUIDE_SHARE * here.beauty if here.guide is None else here.guide,
            denoise={m: here.denoise * x for m, x in model.denoiser_speed.items()},
            network={**networks, **here.networks},
        )


def learn(
    known: Measured | None,
    settings: Settings,
    pixels: int,
    seconds: Mapping[str, float],
    model: Model,
) -> Measured:
    """What is known after one more render, of these seconds by stage.

    Its settings are resolved. A render at another size or in another mode adds to what
    what is known from the ones before.
    """
    seconds = defaultdict(float, seconds)
    before = _resized(known, pixels) if known else Measured(pixels)
    parts = sum(value for stage, value in seconds.items() if stage != "total")
    now = replace(
        before,
        fixed=seconds["sync"] + seconds["write"],
        totals={**before.totals, settings: parts},
    )
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
        networks={network: value * size for network, value in known.networks.items()},
        totals={key: value * size for key, value in known.totals.items()},
    )


def _in_process(settings: Settings) -> Settings:
    """With the denoiser that runs on the low-resolution picture: ours."""
    if settings.is_enlarged and settings.denoising is DEFAULT_DENOISING:
        return replace(settings, denoising=Denoising.XRDS_HIGH)
    return settings
