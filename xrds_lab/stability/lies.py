"""Wrong guides: the network against bicubic, which uses no guides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import baselines, metrics
from .measured import Measured, faults, worst
from .pictures import Inputs, blocks, constant, dome, lit_surface

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from xrds_core.arrays import Array

    from .subject import Subject


def _zero_normals(inputs: Inputs) -> Inputs:
    return inputs._replace(normal=inputs.normal * 0)


def _long_normals(inputs: Inputs) -> Inputs:
    return inputs._replace(normal=inputs.normal * 5)


def _noisy_normals(inputs: Inputs) -> Inputs:
    shape = inputs.normal.shape
    return inputs._replace(normal=2 * blocks(*shape[:2], seed=21) - 1)


def _albedo(value: float) -> Callable[[Inputs], Inputs]:
    return lambda x: x._replace(albedo=constant(*x.albedo.shape[:2], value))


def _emitters(value: float) -> Callable[[Inputs], Inputs]:
    """Albedo as Cycles writes it where a lamp of this strength is in view."""

    def shine(inputs: Inputs) -> Inputs:
        albedo = inputs.albedo.copy()
        third = albedo.shape[0] // 3
        albedo[third : 2 * third, third : 2 * third] += np.float32(value)
        return inputs._replace(albedo=albedo)

    return shine


def _constant_guides(inputs: Inputs) -> Inputs:
    height, width = inputs.albedo.shape[:2]
    return inputs._replace(
        albedo=constant(height, width, 0.5),
        normal=constant(height, width, (0.0, 0.0, 1.0)),
    )


def _shifted(inputs: Inputs) -> Inputs:
    albedo, normal = (
        np.roll(x, (1, 1), (0, 1)) for x in (inputs.albedo, inputs.normal)
    )
    return inputs._replace(albedo=albedo, normal=normal)


def _another_frame(inputs: Inputs) -> Inputs:
    height, width = inputs.albedo.shape[:2]
    return inputs._replace(
        albedo=0.1 + 0.8 * blocks(height, width, seed=31),
        normal=dome(height, width, bumps=5),
    )


LIES: dict[str, Callable[[Inputs], Inputs]] = {
    "zero_normals": _zero_normals,
    "long_normals": _long_normals,
    "noisy_normals": _noisy_normals,
    "albedo_0": _albedo(0.0),
    "albedo_50": _albedo(50.0),
    "emitter_1e6": _emitters(1e6),
    "constant": _constant_guides,
    "shifted": _shifted,
    "another_frame": _another_frame,
}


def lies(subject: Subject) -> Iterator[Measured]:
    """PSNR below bicubic's, in dB; negative values are gains."""
    inputs, truth = lit_surface(subject.side, subject.scale)
    stops = -1.0  # the brightest of it is about 2
    plain = metrics.psnr(
        baselines.bicubic(inputs.radiance, subject.scale), truth, stops
    )
    bad = 0
    for name, lie in LIES.items():
        picture = subject(lie(inputs))
        bad += faults(picture)
        loss = plain - metrics.psnr(np.nan_to_num(picture), truth, stops)
        yield Measured(f"guides.{name}", loss)
    yield Measured("guides.faults", bad)


def rings(subject: Subject) -> Iterator[Measured]:
    """An emitter's outline in the albedo makes no ring on an even wall."""
    height = width = subject.side
    even = Inputs(
        constant(subject.low_side, subject.low_side, 1.0),
        constant(height, width, 0.5),
        constant(height, width, (0.0, 0.0, 1.0)),
    )
    curve = {value: _ring(subject, _emitters(value)(even)) for value in (50.0, 1e6)}
    yield worst("guides.ring", curve)


def _ring(subject: Subject, inputs: Inputs) -> float:
    """Return the largest deviation, of 1, outside the emitter's own pixels."""
    picture: Array = subject(inputs)
    third, reach = subject.side // 3, 2 * subject.scale
    outside = np.ones(picture.shape[:2], bool)
    inner = slice(third - reach, 2 * third + reach)
    outside[inner, inner] = False
    return float(np.abs(picture[outside] - 1.0).max())


CHECKS = (lies, rings)
