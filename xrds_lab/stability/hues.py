"""Colour: grey stays grey, and all channels are treated alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .measured import Measured, smape, worst
from .pictures import Inputs, lit_surface, textured

if TYPE_CHECKING:
    from collections.abc import Iterator

    from xrds_core.arrays import Array

    from .subject import Subject

_PERMUTATIONS = ((1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0))


def grey(subject: Subject) -> Iterator[Measured]:
    """A grey scene gets no tint."""
    curve = {}
    for number, inputs in enumerate(
        (
            lit_surface(subject.side, subject.scale)[0],
            textured(subject.side, subject.scale),
        )
    ):
        picture = subject(
            Inputs(_grey(inputs.radiance), _grey(inputs.albedo), inputs.normal)
        )
        chroma = picture.max(axis=2) - picture.min(axis=2)
        curve[number] = float((chroma / np.maximum(picture.max(axis=2), 1e-30)).max())
    yield worst("grey.chroma", curve)


def _grey(x: Array) -> Array:
    return np.ascontiguousarray(np.broadcast_to(x[..., :1], x.shape))


def permutation(subject: Subject) -> Iterator[Measured]:
    """Channels exchanged in the inputs are exchanged in the picture."""
    inputs, _ = lit_surface(subject.side, subject.scale)
    expected = subject(inputs)
    curve = {}
    for number, order in enumerate(_PERMUTATIONS):
        light, albedo = (
            np.ascontiguousarray(x[..., order])
            for x in (inputs.radiance, inputs.albedo)
        )
        picture = subject(Inputs(light, albedo, inputs.normal))
        curve[number] = smape(picture, expected[..., order])
    yield worst("colour.permutation", curve)


CHECKS = (grey, permutation)
