"""Whether neighbours show what the frame itself shows, asked of its own samples.

The neighbours' mean L and the frame's own mean m differ by what is wrong with L and by
the noise of m. How much of (m - L) squared is noise, `noise` says; the rest, over a few
pixels, is the squared error of L, patterns included. No list of things that may move or
change is needed. The less of the noise V of the frame's light that error E is, the more
the neighbours count: by V / (V + E), which has the least squared error. E counts many
times, since a denoiser takes away most of V and nothing of E.

Guides have little noise and tell at once. Light that changes where guides do not, as a
shadow that moves, is hidden by the frame's own noise; there the neighbours are asked
whether they agree with each other.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .changes import REACH, Changes
from .neighbours import box
from .noise import brightness as root_of_luminance
from .noise import guides_of, noise_of_guides

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored

    Mask = NDArray[np.bool_]

# How often errors that guides show, and light that changes, count against the noise of
# light: divided by the frame's samples, since a denoiser takes away the less of their
# noise the more there are, but no less than `_LEAST`.
_GUIDES, _CHANGES, _LEAST = 512.0, 256.0, 4.0
# Pixels across, over which errors of guides are averaged: by the most samples per
# pixel that ask for so many. Halves of few samples tell little of one pixel.
_GUIDE_AREAS = ((4.0, 9), (np.inf, 5))
# The same of light: pixels across whose mean is compared, and how often it counts.
_MEAN, _LIGHT_AREA, _LIGHT = 3, 5, 4.0
# What could be noise, counted so often, is doubted.
_UNSURE = 6.0
_SMOOTH = 3  # pixels across: weights
_NOISE_AREA = 7
# Squared, summed over the channels: an albedo below it is taken to hold as much light
# for its albedo as the whole frame does.
_DARKEST_ALBEDO = 0.02
_DARKEST_ROOT = 0.1  # the root of an albedo's luminance, in the same way
_EVEN_NOISE = 0.1  # albedo's luminance, added to it: noise is more even than albedo
MARGIN = max(max(a for _, a in _GUIDE_AREAS) // 2, REACH) + _SMOOTH // 2
"""How many pixels to each side of a pixel have a say in it."""
_BEARABLE = 0.03  # of guides alone: what they may be off by and count half
_TINY = np.float32(1e-9)


def light_for_albedo(frame: Stored) -> float:
    """Return what squared error of light's root a squared error of albedo makes.

    A share of albedo is that share of light, and half of it of light's root; on the
    mean of a frame.
    """
    assert frame.noise is not None
    light = float(np.mean(frame.noise.brightness, dtype=np.float64)) ** 2 / 4
    albedo = guides_of(frame.picture[::7, 3:].astype(np.float32))[:, :3]
    squares = float(np.square(albedo).sum(axis=-1).mean(dtype=np.float64))
    return light / (squares + _DARKEST_ALBEDO)


class Judge:
    """Knows the frame's own part, is shown each neighbour, then asked of their mean.

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
        self._guides, self._known = guides_of(picture[..., 3:]), known
        self._brightness, self._noise = brightness, noise
        self._often = [
            np.float32(max(x / samples, _LEAST)) for x in (_GUIDES, _CHANGES)
        ]
        self._area = next(area for most, area in _GUIDE_AREAS if samples <= most)
        self._unsure = np.float32(_UNSURE) * box(noise, max(self._area, _NOISE_AREA))
        texture = root_of_luminance(picture[..., 3:6])
        self._variance = _variance(difference, texture)
        self._chance = np.square(box(difference, _MEAN))
        albedo = box(np.square(self._guides[..., :3]).sum(axis=-1), _SMOOTH)
        light = np.square(box(brightness, _SMOOTH)) / 4
        dark = np.float32(_DARKEST_ALBEDO)
        self._light_for_albedo = (light + dark * np.float32(usual)) / (albedo + dark)
        lit = box(texture, _SMOOTH) + np.float32(_DARKEST_ROOT)
        self._light = box(brightness, _SMOOTH) / lit
        self._untextured = brightness - self._light * texture
        self._changes = Changes((brightness.shape[0], brightness.shape[1]))

    def see(
        self, picture: Array, brightness: Array, difference: Array, weight: Array
    ) -> None:
        """Take note of what a neighbour shows on the frame's pixels.

        All are as the frame's own; `weight` (H, W) is how much each pixel counts.
        """
        # a nearest pixel has other texture than this one, and no other light
        light = brightness - self._light * root_of_luminance(picture[..., 3:6])
        self._changes.add(light - self._untextured, difference, weight)

    def trust(self, passes: Array, brightness: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours whose means are given.

        `passes` (H, W, 6 or 7) are albedo, normal and alpha where there is any,
        `brightness` (H, W) is as the frame's own, where they are `seen` (H, W).
        """
        asked = (seen & self._known).astype(np.float32)
        error = self._guides_apart(passes, asked) + self._light_apart(brightness, asked)
        error += self._unrest
        weight = _mean(self._variance / (self._variance + error), asked, _SMOOTH)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)

    def _guides_apart(self, passes: Array, asked: Array) -> Array:
        apart = guides_of(passes)
        apart -= self._guides
        apart = np.einsum("ijk,ijk->ij", apart, apart) - self._noise
        error = _doubted(_mean(apart, asked, self._area), self._unsure)
        return np.asarray(self._often[0] * self._light_for_albedo * error)

    def _light_apart(self, brightness: Array, asked: Array) -> Array:
        apart = np.square(box((self._brightness - brightness) * asked, _MEAN))
        unsure = np.float32(_UNSURE / _MEAN**2) * self._variance
        error = _doubted(box(apart - self._chance, _LIGHT_AREA), unsure)
        return np.asarray(np.float32(_LIGHT) * error)

    @cached_property
    def _unrest(self) -> Array:
        return np.asarray(self._often[1] * self._changes.error())


class GuideJudge:
    """As `Judge` of frames of guides alone: albedo, normal, and alpha if there is any.

    What is wrong with the neighbours' mean counts once against the noise of the frame's
    guides: no denoiser is to take it away. `picture` (H, W, 6 or 7) has samples
    where it is `known` (H, W).
    """

    def __init__(self, picture: Array, known: Mask) -> None:
        self._guides, self._known = guides_of(picture), known
        # believed in full, as of one sample: to lend too little is a loss here, too
        noise = noise_of_guides(self._guides, 1.0)
        self._variance = box(np.square(noise), _NOISE_AREA)

    def trust(self, passes: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours whose means are given.

        `passes` (H, W, 6 or 7) are as the frame's own, where they are `seen` (H, W).
        """
        asked = (seen & self._known).astype(np.float32)
        apart = guides_of(passes)
        apart -= self._guides
        apart = np.einsum("ijk,ijk->ij", apart, apart)
        error = _mean(apart, asked, _SMOOTH) - self._variance
        error = np.maximum(error, np.float32(0.0))
        variance = self._variance + np.float32(_BEARABLE**2)
        weight = _mean(variance / (variance + error), asked, _SMOOTH)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)


def _variance(difference: Array, texture: Array) -> Array:
    """Return the variance (H, W) of the root of light, from one of a few pixels.

    The root of a light's noise is as dark as the albedo's, so a dark joint between
    bright stones has little noise, whatever there is around it.
    """
    share = np.square(texture) + np.float32(_EVEN_NOISE)
    near = box(np.square(difference), _NOISE_AREA) / box(share, _NOISE_AREA)
    return np.asarray(near * share + _TINY)


def _mean(x: Array, asked: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels of those `asked` (0 or 1)."""
    return np.asarray(box(x * asked, size) / np.maximum(box(asked, size), _TINY))


def _doubted(error: Array, unsure: Array) -> Array:
    """Return an error, less where it could be chance."""
    error = np.maximum(error, np.float32(0.0))
    return np.asarray(np.square(error) / (error + unsure + _TINY))
