"""Range, energy and darkness: the laws of light that a picture must keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import baselines
from .measured import Measured, distance, faults, relative_difference, worst
from .pictures import Inputs, area_mean, blocks, constant, even, lit_surface, textured
from .pictures import waves as smooth_light

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .subject import Subject

_NEAR = (-20, -7, 7, 20)  # powers of two
_FAR = (-40, -30, 30, 40)


def scaling(subject: Subject) -> Iterator[Measured]:
    """A brighter scene gives a picture brighter by the same factor."""
    inputs = textured(subject.side, subject.scale)
    expected = subject(inputs)

    def difference(power: int) -> float:
        light = inputs.radiance * np.float32(2.0**power)
        picture = subject(inputs.with_radiance(light)) * np.float32(2.0**-power)
        return relative_difference(picture, expected)

    for name, powers in (("range.scaling", _NEAR), ("range.scaling_far", _FAR)):
        yield worst(name, {power: difference(power) for power in powers})


def spread(subject: Subject) -> Iterator[Measured]:
    """Twelve decades in one picture: the dark half keeps its detail."""
    inputs, truth = lit_surface(subject.side, subject.scale)
    dark, bright = np.float32(1e-6), np.float32(1e6)
    middle = subject.side // 2
    factor = np.where(np.arange(subject.side) < middle, dark, bright)[:, None]
    low = inputs.radiance * factor[:: subject.scale, None]
    picture = subject(inputs.with_radiance(low))
    rows = np.s_[: middle - 2 * subject.scale]
    error = np.abs(picture / dark - truth)[rows].mean() / truth[rows].mean()
    bicubic = baselines.bicubic(inputs.radiance, subject.scale)
    plain = np.abs(bicubic - truth)[rows].mean() / truth[rows].mean()
    yield Measured("range.spread_faults", faults(picture))
    yield Measured("range.spread_error", float(error / plain))


def constants(subject: Subject) -> Iterator[Measured]:
    """A picture of one colour is not changed."""
    curve = {}
    for albedo in (0.0, 0.05, 0.5, 1.0):
        picture = subject(even(subject.side, subject.scale, 0.7, albedo))
        curve[albedo] = float(np.abs(picture / 0.7 - 1.0).max())
    yield worst("constant.value", curve)


def tiny(subject: Subject) -> Iterator[Measured]:
    """Light near the least that a float can hold."""
    inputs = textured(subject.side, subject.scale)
    bad = 0
    for value in (1e-45, 1e-40, 1.2e-38):
        low = constant(subject.low_side, subject.low_side, value)
        picture = subject(inputs.with_radiance(low))
        bad += faults(picture) + int((picture > 100 * value).sum())
    yield Measured("range.denormal_faults", bad)


def black(subject: Subject) -> Iterator[Measured]:
    """No light stays no light, whatever the surfaces look like."""
    inputs = textured(subject.side, subject.scale)
    picture = subject(inputs.with_radiance(inputs.radiance * 0))
    yield Measured("black.all", float(np.abs(picture).max()))
    half = subject.low_side // 2
    low = inputs.radiance.copy()
    low[:, :half] = 0.0
    picture = subject(inputs.with_radiance(low))
    dark = picture[:, : (half - 1) * subject.scale]
    yield Measured("black.half", float(dark.max() / low.mean()))


def one_pixel(subject: Subject) -> Iterator[Measured]:
    """The light of a single lit pixel stays near it and does not grow."""
    inputs = textured(subject.side, subject.scale)
    middle = subject.low_side // 2
    low = inputs.radiance * 0
    low[middle, middle] = 1.0
    picture = subject(inputs.with_radiance(low))
    away = distance(subject.side, subject.scale, [(middle, middle)]) > subject.scale
    total = float(picture.sum())
    yield Measured("lit_pixel.away", float(picture[away].sum()) / max(total, 1e-30))
    yield Measured("lit_pixel.gain", total / (3 * subject.scale**2))


def energy(subject: Subject) -> Iterator[Measured]:
    """Smooth light on even, smoothly coloured and painted walls keeps its mean."""
    side, scale = subject.side, subject.scale
    light = smooth_light(side, side, 5)
    facing = constant(side, side, (0.0, 0.0, 1.0))
    walls = {0: constant(side, side, 0.5), 1: 0.45 * smooth_light(side, side, 6)}
    curve = {}
    for kind, albedo in walls.items():
        truth = light * albedo
        picture = subject(Inputs(area_mean(truth, scale), albedo, facing))
        curve[kind] = abs(float(picture.mean(dtype=np.float64) / truth.mean()) - 1.0)
    yield worst("energy.smooth", curve)
    albedo = 0.1 + 0.8 * blocks(side, side, 4)
    truth = light * albedo
    picture = subject(Inputs(area_mean(truth, scale), albedo, facing))
    gain = float(picture.mean(dtype=np.float64) / truth.mean(dtype=np.float64))
    yield Measured("energy.textured", abs(gain - 1.0))


CHECKS = (scaling, spread, constants, tiny, black, one_pixel, energy)
