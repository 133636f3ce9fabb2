"""Whether neighbours show what the frame itself shows: asked of the frame's own halves.

The neighbours' mean L and the frame's own mean m differ by what is wrong with L and by
the noise of m. Halves of the frame's samples say how much of (m - L) squared is noise,
so the rest, over a few pixels, is the squared error of L, patterns included. No list of
things that may move or change is needed. The less of the noise V of the frame's light
that error E is, the more the neighbours count: by V / (V + E), which has the least
squared error. E counts many times, since a denoiser takes away most of V and nothing
of E.

Guides have little noise and tell at once. Light that changes where guides do not, as a
shadow that moves, is asked for in means of 3x3 and 7x7 pixels, where its noise is less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .halves import guides_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array

    Mask = NDArray[np.bool_]

MARGIN = 8  # pixels to each side of a pixel that have a say in it
# How often the errors that guides and light show count, against the noise of light.
_GUIDES, _LIGHT = 256.0, 4.0
# What could be noise, counted so often, is doubted.
_UNSURE = 4.0
_AREA = 5  # pixels across, over which errors of guides are averaged
# Pixels across: means of light, and over how many of these the error is averaged.
_LIGHT_AREAS = ((3, 5), (7, 7))
_NOISE_AREA = 7
_DARKEST_ALBEDO = np.float32(0.02)  # squared, summed over the channels
_TINY = np.float32(1e-9)


class Judge:
    """Knows the frame's own part; asked of the mean of any neighbours.

    `picture` (H, W, 9 or 10) is radiance, albedo, normal, and alpha where there is any.
    `brightness` and `difference` (H, W) are those of `Noise`, `noise` (H, W) is the
    variance of the guides. Pixels are `known` (H, W) where they have samples. Of a part
    of a frame the outer `MARGIN` rows are of no use.
    """

    def __init__(
        self,
        picture: Array,
        brightness: Array,
        difference: Array,
        noise: Array,
        known: Mask,
    ) -> None:
        self._guides, self._known = guides_of(picture), known
        self._brightness, self._noise = brightness, noise
        self._unsure = np.float32(_UNSURE) * box(noise, _AREA)
        self._variance = box(np.square(difference), _NOISE_AREA) + _TINY
        self._chance = [np.square(box(difference, size)) for size, _ in _LIGHT_AREAS]
        # A share of albedo is that share of light, and half of it of light's root.
        albedo = box(np.square(self._guides[..., :3]).sum(axis=-1), _AREA)
        light = np.square(box(brightness, _AREA)) / 4
        self._light_of_guides = light / (albedo + _DARKEST_ALBEDO)

    def trust(self, mean: Array, brightness: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours whose mean is given.

        `mean` is as the frame's own picture, `brightness` (H, W) as its own, where
        they are `seen` (H, W).
        """
        asked = (seen & self._known).astype(np.float32)
        error = np.float32(_GUIDES) * self._light_of_guides
        error *= self._error_of_guides(mean, asked)
        error += np.float32(_LIGHT) * self._error_of_light(brightness, asked)
        weight = self._variance / (self._variance + error)
        weight = box(weight * asked, _AREA) / np.maximum(box(asked, _AREA), _TINY)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)

    def _error_of_guides(self, mean: Array, asked: Array) -> Array:
        apart = np.square(guides_of(mean) - self._guides).sum(axis=-1) - self._noise
        error = box(apart * asked, _AREA) / np.maximum(box(asked, _AREA), _TINY)
        return _doubted(error, self._unsure)

    def _error_of_light(self, brightness: Array, asked: Array) -> Array:
        apart = (self._brightness - brightness) * asked
        total = np.zeros_like(apart)
        for (size, area), chance in zip(_LIGHT_AREAS, self._chance, strict=True):
            error = box(np.square(box(apart, size)) - chance, area)
            unsure = np.float32(_UNSURE / size**2) * self._variance
            total += _doubted(error, unsure)
        return total


def _doubted(error: Array, unsure: Array) -> Array:
    """Return an error, less where it could be chance."""
    error = np.maximum(error, np.float32(0.0))
    return np.asarray(np.square(error) / (error + unsure + _TINY))


def box(x: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels, an odd number; 0 lies beyond.

    (H, W) -> (H, W).
    """
    wide = np.pad(x, size // 2)
    rows = _sums(wide, x.shape[0], size)
    columns = _sums(rows.T, x.shape[1], size).T
    return np.asarray(columns * np.float32(1.0 / size**2))


def _sums(x: Array, count: int, size: int) -> Array:
    total = x[:count].copy()
    for i in range(1, size):
        total += x[i : i + count]
    return total
