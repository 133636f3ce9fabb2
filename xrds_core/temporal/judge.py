"""Whether neighbours show what the frame itself shows: asked of the frame's own halves.

The neighbours' mean L and the frame's own mean m differ by what is wrong with L and by
the noise of m. Halves of the frame's samples say how much of (m - L) squared is noise,
so the rest, over a few pixels, is the squared error of L, patterns included. No list of
things that may move or change is needed. The less of the noise V of the frame's light
that error E is, the more the neighbours count: by V / (V + E), which has the least
squared error. E counts many times, since a denoiser takes away most of V and nothing
of E.

Guides have little noise and tell at once. Light that changes where guides do not, as a
shadow that moves, is asked for in means of 3x3, 7x7 and 15x15 pixels, where its noise
is less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .halves import guides_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored

    Mask = NDArray[np.bool_]

MARGIN = 13  # pixels to each side of a pixel that have a say in it
# How often the error that guides show counts, against the noise of light.
_GUIDES = 256.0
# Pixels across, over which errors of guides are averaged: by the most samples per
# pixel that ask for so many. Halves of a sample or two tell little of one pixel.
_GUIDE_AREAS = ((2.0, 15), (4.0, 9), (np.inf, 5))
# Means of light: pixels across, over how many of them the error is averaged, and how
# often it counts. Of the widest ones that falls with the samples: noise that is so wide
# is what a denoiser takes away the better, the more of it there is.
_LIGHT_AREAS = ((3, 5, 4.0), (7, 7, 16.0), (15, 9, 1024.0))
_WIDE = 15
# What could be noise, counted so often, is doubted.
_UNSURE = 4.0
_SMOOTH = 5  # pixels across: weights
_NOISE_AREA = 7
# Squared, summed over the channels: an albedo below it is taken to hold as much light
# for its albedo as the whole frame does.
_DARKEST_ALBEDO = 0.02
_TINY = np.float32(1e-9)


def light_for_albedo(frame: Stored) -> float:
    """Return what squared error of light's root a squared error of albedo makes.

    A share of albedo is that share of light, and half of it of light's root; on the
    mean of a frame.
    """
    assert frame.noise is not None
    light = float(np.mean(frame.noise.brightness, dtype=np.float64)) ** 2 / 4
    albedo = guides_of(frame.picture[::7].astype(np.float32))[:, :3]
    squares = float(np.square(albedo).sum(axis=-1).mean(dtype=np.float64))
    return light / (squares + _DARKEST_ALBEDO)


class Judge:
    """Knows the frame's own part; asked of the mean of any neighbours.

    `picture` (H, W, 9 or 10) is radiance, albedo, normal, and alpha where there is any.
    `brightness` and `difference` (H, W) are those of `Noise`, `noise` (H, W) is the
    variance of the guides. Pixels are `known` (H, W) where they have samples, `samples`
    each on the mean. `usual` is `light_for_albedo` of the whole frame. Of a part of a
    frame the outer `MARGIN` rows are of no use.
    """

    def __init__(
        self,
        picture: Array,
        brightness: Array,
        difference: Array,
        noise: Array,
        known: Mask,
        samples: float,
        usual: float,
    ) -> None:
        self._guides, self._known = guides_of(picture), known
        self._brightness, self._noise = brightness, noise
        self._samples = samples
        self._area = next(area for most, area in _GUIDE_AREAS if samples <= most)
        self._unsure = np.float32(_UNSURE) * box(noise, max(self._area, _NOISE_AREA))
        self._variance = box(np.square(difference), _NOISE_AREA) + _TINY
        self._chance = [np.square(box(difference, size)) for size, *_ in _LIGHT_AREAS]
        albedo = box(np.square(self._guides[..., :3]).sum(axis=-1), _SMOOTH)
        light = np.square(box(brightness, _SMOOTH)) / 4
        dark = np.float32(_DARKEST_ALBEDO)
        self._light_for_albedo = (light + dark * np.float32(usual)) / (albedo + dark)

    def trust(self, mean: Array, brightness: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours whose mean is given.

        `mean` is as the frame's own picture, `brightness` (H, W) as its own, where
        they are `seen` (H, W).
        """
        asked = (seen & self._known).astype(np.float32)
        error = np.float32(_GUIDES) * self._light_for_albedo
        error *= self._error_of_guides(mean, asked)
        error += self._error_of_light(brightness, asked)
        weight = _mean(self._variance / (self._variance + error), asked, _SMOOTH)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)

    def _error_of_guides(self, mean: Array, asked: Array) -> Array:
        apart = np.square(guides_of(mean) - self._guides).sum(axis=-1) - self._noise
        return _doubted(_mean(apart, asked, self._area), self._unsure)

    def _error_of_light(self, brightness: Array, asked: Array) -> Array:
        """As often as it counts."""
        apart = (self._brightness - brightness) * asked
        total = np.zeros_like(apart)
        for (size, area, often), chance in zip(_LIGHT_AREAS, self._chance, strict=True):
            error = box(np.square(box(apart, size)) - chance, area)
            unsure = np.float32(_UNSURE / size**2) * self._variance
            counts = often / self._samples if size == _WIDE else often
            total += np.float32(counts) * _doubted(error, unsure)
        return total


def _mean(x: Array, asked: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels of those `asked` (0 or 1)."""
    return np.asarray(box(x * asked, size) / np.maximum(box(asked, size), _TINY))


def _doubted(error: Array, unsure: Array) -> Array:
    """Return an error, less where it could be chance."""
    error = np.maximum(error, np.float32(0.0))
    return np.asarray(np.square(error) / (error + unsure + _TINY))


def box(x: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels, an odd number, of those inside.

    (H, W) -> (H, W).
    """
    wide = np.pad(x, size // 2)
    rows = _sums(wide, x.shape[0], size)
    sums = _sums(rows.T, x.shape[1], size).T
    sums *= _shares(x.shape[0], size)[:, None]
    sums *= _shares(x.shape[1], size)
    return np.asarray(sums)


def _shares(side: int, size: int) -> Array:
    """Return 1 / how many of `size` pixels around each of a side are inside."""
    inside = np.arange(side)
    first, last = np.maximum(inside - size // 2, 0), inside + size // 2
    return (1.0 / (np.minimum(last, side - 1) - first + 1)).astype(np.float32)


def _sums(x: Array, count: int, size: int) -> Array:
    """Return the sums of `size` rows that follow each other, by thirds where it can."""
    if size > 3 and size % 3 == 0:
        third = size // 3
        part = _sums(x, count + 2 * third, third)
        return np.asarray(
            part[:count] + part[third : third + count] + part[2 * third :]
        )
    total = x[:count].copy()
    for i in range(1, size):
        total += x[i : i + count]
    return total
