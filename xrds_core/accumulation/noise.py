"""The noise of a frame: of its light from half buffers, of its guides from themselves.

Guides are smooth along the surfaces they show, in one direction at least. So the
smallest of a pixel's second differences, in four directions, is noise. Without half
buffers the noise of light is estimated from the surrounding pixels as well: light
divided by albedo is smooth in most places.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import LARGEST_HALF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array


# Albedo beyond this is a lamp; it must not dominate the pixels around it.
_BRIGHTEST = 4.0
# Normals change where nothing else does, so they weigh less than albedo.
_NORMAL_SHARE = 0.1
# Ratio of the variance of guides to the smallest difference, squared: 3.6 if guides
# were pure noise. The more samples, the more of the difference is texture.
_LEAST, _OF_ONE_SAMPLE = 1.2, 2.5
# Variance that half buffers of few samples show beyond that of the surrounding pixels:
# halves of one sequence complement each other, and noise that light shares with albedo
# is left out.
_HALVES_EXCESS = 1.0
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec.709


@dataclass(frozen=True, eq=False)
class Noise:
    """Estimates of a frame's noise, flat, in half floats.

    Attributes
    ----------
    light : (H W, 2) float16 array
        Brightness and difference: the mean over both halves of the square root of
        luminance, and half the difference of these roots. They lie side by side since
        they are gathered together.
    guides : (H W,) float16 array
        Standard deviation of the frame's guides.
    """

    light: NDArray[np.float16]
    guides: NDArray[np.float16]

    @classmethod
    def of(cls, brightness: Array, difference: Array, guides: Array) -> Noise:
        """Pack these, each of as many pixels; what is not finite becomes it."""
        light = np.empty((brightness.size, 2), np.float16)
        light[:, 0], light[:, 1] = _pack(brightness), _pack(difference)
        return cls(light, _pack(guides))

    @property
    def brightness(self) -> NDArray[np.float16]:
        """(H W)."""
        return self.light[:, 0]

    @property
    def difference(self) -> NDArray[np.float16]:
        """(H W)."""
        return self.light[:, 1]

    def without(self, invalid: NDArray[np.bool_]) -> Noise:
        """Return the same with 0 at `invalid` pixels (H W)."""
        light, guides = self.light.copy(), self.guides.copy()
        light[invalid], guides[invalid] = 0.0, 0.0
        return Noise(light, guides)

    def within(
        self,
        share: Array,
        others: Array,
        place: slice | NDArray[np.integer] = slice(None),
    ) -> Noise:
        """Return the noise of a mean in which these samples have a share.

        Parameters
        ----------
        share : (n,) float32 array
            Share of these samples in the mean.
        others : (n,) float32 array
            Brightness of the other samples; NaN where there are none.
        place : slice or int array
            The pixels that `share` and `others` are of; elsewhere the noise stays.

        Returns
        -------
        noise : Noise
        """
        rest = np.nan_to_num(others, posinf=0.0, neginf=0.0)
        light, guides = self.light.copy(), self.guides.copy()
        old = light[place].astype(np.float32)
        root = np.sqrt(share)
        light[place, 0] = _pack(rest + (old[:, 0] - rest) * share)
        light[place, 1] = _pack(old[:, 1] * root)
        guides[place] = _pack(guides[place].astype(np.float32) * root)
        return Noise(light, guides)


def brightness(radiance: Array) -> Array:
    """Return the square root of luminance (..., 3) -> (...).

    The root equalises the noise of dark and bright pixels, so that a few bright ones
    do not dominate.
    """
    return np.asarray(np.sqrt(luminance(radiance)))


def luminance(radiance: Array) -> Array:
    """Return the luminance (..., 3) -> (...), not below 0."""
    return np.maximum(radiance @ _LUMINANCE, np.float32(0.0))


def guides_of(passes: Array) -> Array:
    """Scale guides for comparison.

    Parameters
    ----------
    passes : (..., 6 or 7) float32 array
        Albedo, normal and, if there is one, alpha.

    Returns
    -------
    guides : (..., 6 or 7) float32 array
    """
    scale = np.ones(passes.shape[-1], np.float32)
    scale[3:6] = _NORMAL_SHARE**0.5
    guides = passes * scale
    np.clip(guides, -_BRIGHTEST, _BRIGHTEST, out=guides)
    return guides


def guide_factor(samples: float) -> float:
    """Return the standard deviation of guides to their smallest difference."""
    return (_LEAST * (1.0 + _OF_ONE_SAMPLE / samples)) ** 0.5


def light_factor(samples: float) -> float:
    """Return how much more the halves of a frame differ than its pixels from others.

    The surrounding pixels make up eight ninths of what a pixel is compared with.
    """
    return (9 / 8 * (1.0 + _HALVES_EXCESS / samples)) ** 0.5


def _pack(values: Array) -> NDArray[np.float16]:
    """Return half floats (n,), the largest ones for infinities, 0 for NaN."""
    finite = np.nan_to_num(values.ravel(), nan=0.0)
    return np.clip(finite, -LARGEST_HALF, LARGEST_HALF).astype(np.float16)
