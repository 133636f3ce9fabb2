"""Measures how many samples a frame with neighbours needs.

A frame of few samples, accumulated and denoised, has the error of a frame of more
samples without neighbours. How many more is measured without a reference: for two
independent renders a, b that a picture was not made of, the mean of
(picture - a)(picture - b) is its squared error, without bias. From there on it is
enough to count what neighbours add, where there is noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..accumulation.accumulate import sample_counts
from ..accumulation.local_filters import block_means, box
from ..accumulation.noise import luminance
from ..arrays import floats
from .worth import FALL, Errors

if TYPE_CHECKING:
    from ..accumulation.accumulate import Accumulated
    from ..accumulation.frame import Stored
    from ..arrays import Array


# Share of the blocks, those with most noise, that an error is not measured in.
_NOISIEST = 0.01
_DARKEST = 0.02  # of the mean luminance, added to the light of each channel
_SMOOTH = 7  # pixels across
_SEEN = 3  # pixels across: the light that an error is relative to
_TINY = 1e-12


@dataclass(frozen=True)
class Rendered:
    """One frame's samples as rendered (H, W, 3), and denoised by themselves."""

    noisy: Array
    denoised: Array


@np.errstate(over="ignore", invalid="ignore")  # radiance near float's limit
def measure_errors(
    picture: Array,
    alone: Array,
    noisy: Array,
    parts: tuple[Rendered, Rendered],
    exposure: float = 1.0,
) -> Errors:
    """Return the squared errors of a frame with and without neighbours.

    Errors count as they are seen: relative to the local light of their channel, and
    less where it is beyond white. An error by two noisy renders has the product of
    their noises in it. So a picture's is that of a part, and their difference by one
    render.

    Parameters
    ----------
    picture : (H, W, 3) float32 array
        Radiance of a picture that was made without `parts`.
    alone : (H, W, 3) float32 array
        The same without neighbours.
    noisy : (H, W, 3) float32 array
        Radiance, the mean of samples that the parts do not have either.
    parts : tuple of Rendered
        Two renders, each with all samples and a seed of its own.
    exposure : float
        White is a radiance of 1 / `exposure`.

    Returns
    -------
    errors : Errors
    """
    first_part, second_part = parts
    shown = (picture + first_part.denoised + second_part.denoised) / 3
    dark = max(float(np.nan_to_num(luminance(shown)).mean()) * _DARKEST, _TINY)
    light = [box(np.nan_to_num(shown[..., i]), _SEEN) for i in range(3)]
    bright = np.maximum(np.stack(light, axis=-1), 0.0) + np.float32(dark)
    pressed = 1.0 + bright * np.float32(exposure)  # tones beyond white
    scale = np.nan_to_num(1.0 / (bright * pressed**2), posinf=0.0)

    def product(first: Array, second: Array) -> Array:
        products = (first * second * scale).mean(-1)
        return block_means(np.nan_to_num(products, posinf=0.0, neginf=0.0))

    noise = product(
        first_part.noisy - second_part.noisy, first_part.noisy - second_part.noisy
    )
    kept = noise <= np.quantile(noise, 1.0 - _NOISIEST)
    whole, more = np.zeros(noise.shape), np.zeros((2, *noise.shape))
    for made, other in (
        (first_part.denoised, second_part.noisy),
        (second_part.denoised, first_part.noisy),
    ):
        apart = made - other
        whole += product(apart, made - noisy)
        # the difference of two squares: noise counts once in it, and little
        steps = picture - made, alone - made
        more += [product(step, step + 2.0 * apart) for step in steps]
    fewer, by_itself = (whole + more)[:, kept] / 2
    return Errors(fewer, whole[kept] / 2, by_itself)


def gain(accumulated: Accumulated, own: Stored, factor: float = 1.0) -> float:
    """Return how many times its own samples a frame equals with its neighbours'.

    Errors fall with `FALL`; the noise of a pixel is its weight.

    Parameters
    ----------
    accumulated : Accumulated
        The frame with its neighbours' samples.
    own : Stored
        The frame as rendered.
    factor : float
        The gain is that of `factor` times the reused samples.

    Returns
    -------
    gain : float
        1 where neighbours bring nothing.
    """
    assert own.noise is not None
    halves = np.square(floats(own.noise.difference)).reshape(own.shape)
    noise = box(halves, _SMOOTH) + np.float32(_TINY)  # halves may agree by chance
    alone = sample_counts(own).reshape(own.shape)
    reused = np.maximum(accumulated.samples - alone, 0.0) * np.float32(factor)
    share = alone / np.maximum(alone + reused, _TINY)
    left = float(np.average(share**FALL, weights=noise))
    return float(max(left, _TINY) ** (-1.0 / FALL))
