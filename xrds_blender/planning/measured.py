"""What finished renders of a scene tell about the next one's seconds.

Pure functions: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from .budget import Choice, Costs, Model, Network
from .denoiser import DEFAULT_DENOISER, Denoiser
from .ways import Asked, Way, choice_of

# A frame of more pixels than this many times those measured is not told of: what a
# small one takes to begin would count too much.
MOST_GROWTH = 4
# A guide sample's seconds over a full one's, where no guides were rendered yet: 0.56 to
# 0.73 in the scenes of docs/performance.md.
GUIDE_SHARE = 0.65


@dataclass(frozen=True)
class Measured:
    """Seconds of a frame's parts, for the whole frame of `pixels` at full size.

    `fixed`: scene sync, BVH and writing; `beauty` and `guide`: one sample; `denoise`:
    Blender's default denoiser; `networks`: each that has run; `totals`: renders as they
    were. None is what no render has told yet.
    """

    pixels: int
    fixed: float = 0.0
    beauty: float | None = None
    guide: float | None = None
    denoise: float | None = None
    networks: Mapping[Network, float] = field(default_factory=dict)
    totals: Mapping[tuple[Way, Asked], float] = field(default_factory=dict)

    def seconds(
        self, way: Way, asked: Asked, pixels: int, model: Model
    ) -> float | None:
        """Those that the way will about take; `pixels` may be another number."""
        here = _resized(self, pixels)
        if (way, asked) in here.totals:
            return here.totals[way, asked]
        choice = choice_of(way, asked)
        if here.beauty is None:
            return None
        if choice is None:
            return here.fixed + asked.samples * here.beauty
        costs = here.costs(pixels, model)
        try:
            return costs and costs.seconds(_in_process(choice))
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
    way: Way,
    asked: Asked,
    pixels: int,
    seconds: Mapping[str, float],
    model: Model,
) -> Measured:
    """What is known after one more render, of these seconds by stage.

    A render at another size or way adds to what the ones before have told.
    """
    seconds = defaultdict(float, seconds)
    before = _resized(known, pixels) if known else Measured(pixels)
    parts = sum(value for stage, value in seconds.items() if stage != "total")
    now = replace(
        before,
        fixed=seconds["sync"] + seconds["write"],
        totals={**before.totals, (way, asked): parts},
    )
    if way.is_enlarged:
        return _of_enlarged(now, way, asked, seconds, model)
    if way is Way.FULL_SIZE:
        mode = Denoiser(f"XRDS-{asked.denoise.upper()}")
        denoise = seconds["denoise"] / model.denoiser_speed[mode]
        beauty = seconds["beauty"] / asked.samples
        return replace(now, beauty=beauty, denoise=denoise)
    return _of_plain(now, asked, seconds["beauty"], model)


def _of_enlarged(
    now: Measured, way: Way, asked: Asked, seconds: Mapping[str, float], model: Model
) -> Measured:
    area = way.scale**2
    denoise = now.denoise
    if denoise is None and seconds["denoise"] and area <= MOST_GROWTH:
        denoise = seconds["denoise"] * area / model.denoiser_speed[Denoiser.XRDS_HIGH]
    network = {asked.network(way.scale): seconds["network"]}
    return replace(
        now,
        beauty=seconds["beauty"] * area / asked.samples,
        guide=seconds["guides"] / asked.guide_samples,
        denoise=denoise,
        networks={**now.networks, **network},
    )


def _of_plain(now: Measured, asked: Asked, spent: float, model: Model) -> Measured:
    """Cycles does not tell its denoiser from its samples, so that must be known."""
    if asked.plain_denoiser is None:
        return replace(now, beauty=spent / asked.samples)
    if now.denoise is None:
        return now
    denoising = now.denoise * model.denoiser_speed[asked.plain_denoiser]
    if denoising >= spent:
        return now
    return replace(now, beauty=(spent - denoising) / asked.samples)


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


def _in_process(choice: Choice) -> Choice:
    """The choice with the denoiser that runs on the low-resolution picture: ours."""
    if choice.scale == 1 or choice.denoiser is not DEFAULT_DENOISER:
        return choice
    return replace(choice, denoiser=Denoiser.XRDS_HIGH)
