"""Similarity weights: how far the neighbours show what the frame itself shows.

The neighbours' mean L and the frame's own mean m differ by the error of L and by the
noise of m. `noise` estimates how much of (m - L) squared is noise; the rest, averaged
over a few pixels, is the squared error of L, whatever its cause: no list of what may
move or change is needed. The smaller this error E is against V, the variance of the
frame's own light, the more the neighbours count: V / (V + E) minimises the squared
error. E is multiplied by a penalty, since a denoiser removes most of V and nothing of
E.

Guides have little noise and show errors at once. Light that changes where guides do
not, as a moving shadow, is hidden by the frame's own noise; there the neighbours are
compared with each other (`changes`).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .changes import REACH, Changes
from .local_filters import box
from .noise import brightness as root_of_luminance
from .noise import guides_of, noise_of_guides

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored

    Mask = NDArray[np.bool_]

# Penalties: factors on errors seen in guides, and on light that changes, against the
# noise of light. They are divided by the frame's samples per pixel, since a denoiser
# removes less noise the more samples there are, but are never less than `_LEAST`.
_GUIDES, _CHANGES, _LEAST = 512.0, 256.0, 4.0
# (samples per pixel up to, pixels across): over how many pixels errors of guides are
# averaged. Half buffers of few samples say little about one pixel.
_GUIDE_AREAS = ((4.0, 9), (np.inf, 5))
# The same for light: pixels across whose mean is compared, and the penalty.
_MEAN, _LIGHT_AREA, _LIGHT = 3, 5, 4.0
# An error below this many times what noise could explain is discounted.
_UNSURE = 6.0
_SMOOTH = 3  # pixels across: weights
_NOISE_AREA = 7
# Squared, summed over the channels: below this albedo the ratio of light to albedo is
# taken from the whole frame.
_DARKEST_ALBEDO = 0.02
_DARKEST_ROOT = 0.1  # the same for the square root of an albedo's luminance
_EVEN_NOISE = 0.1  # albedo's luminance, added to it: noise is more even than albedo
MARGIN = max(max(a for _, a in _GUIDE_AREAS) // 2, REACH) + _SMOOTH // 2
"""Pixels on each side of a pixel that influence its weight."""
_BEARABLE = 0.03  # frames of guides alone: the error at which neighbours count half
_TINY = np.float32(1e-9)


def light_for_albedo(frame: Stored) -> float:
    """Return the squared error of light's square root per squared error of albedo.

    A relative error of albedo is the same relative error of light, and half as much of
    its square root. The mean over a frame.
    """
    assert frame.noise is not None
    light = float(np.mean(frame.noise.brightness, dtype=np.float64)) ** 2 / 4
    albedo = guides_of(frame.picture[::7, 3:].astype(np.float32))[:, :3]
    squares = float(np.square(albedo).sum(axis=-1).mean(dtype=np.float64))
    return light / (squares + _DARKEST_ALBEDO)


def penalties(samples: float) -> tuple[np.float32, np.float32]:
    """Return those of errors seen in guides, and of light that changes."""
    guides, changes = (max(x / samples, _LEAST) for x in (_GUIDES, _CHANGES))
    return np.float32(guides), np.float32(changes)


def guide_area(samples: float) -> int:
    """Return over how many pixels across errors of guides are averaged."""
    return next(area for most, area in _GUIDE_AREAS if samples <= most)


class Similarity:
    """Compares a frame with its neighbours: `add` each of them, then get `weights`.

    `picture` (H, W, 9 or 10) is the frame's radiance, albedo, normal, and alpha where
    there is any. `brightness` and `difference` (H, W) are those of `Noise`, `noise`
    (H, W) is the variance of the guides. `known` (H, W) marks pixels with samples,
    `samples` of them each on average. `usual` is `light_for_albedo` of the whole frame.
    Of a part of a frame the outer `MARGIN` rows have no valid weights.
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
        self._penalties, self._area = penalties(samples), guide_area(samples)
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

    def add(
        self, picture: Array, brightness: Array, difference: Array, weight: Array
    ) -> None:
        """Add what a neighbour shows on the frame's pixels.

        The arrays are as the frame's own; `weight` (H, W) is the weight of each pixel.
        """
        # the nearest pixel differs in texture from this one, but not in light
        light = brightness - self._light * root_of_luminance(picture[..., 3:6])
        self._changes.add(light - self._untextured, difference, weight)

    def weights(self, passes: Array, brightness: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours with the given means.

        `passes` (H, W, 6 or 7) are albedo, normal and alpha where there is any,
        `brightness` (H, W) is as the frame's own, where they are `seen` (H, W).
        """
        valid = (seen & self._known).astype(np.float32)
        error = self._guides_apart(passes, valid) + self._light_apart(brightness, valid)
        error += self._change_error
        weight = _mean(self._variance / (self._variance + error), valid, _SMOOTH)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)

    def _guides_apart(self, passes: Array, valid: Array) -> Array:
        apart = guides_of(passes)
        apart -= self._guides
        apart = np.einsum("ijk,ijk->ij", apart, apart) - self._noise
        error = _discounted(_mean(apart, valid, self._area), self._unsure)
        return np.asarray(self._penalties[0] * self._light_for_albedo * error)

    def _light_apart(self, brightness: Array, valid: Array) -> Array:
        apart = np.square(box((self._brightness - brightness) * valid, _MEAN))
        unsure = np.float32(_UNSURE / _MEAN**2) * self._variance
        error = _discounted(box(apart - self._chance, _LIGHT_AREA), unsure)
        return np.asarray(np.float32(_LIGHT) * error)

    @cached_property
    def _change_error(self) -> Array:
        return np.asarray(self._penalties[1] * self._changes.error())


class GuideSimilarity:
    """`Similarity` for frames of guides alone: albedo, normal, and alpha if any.

    The error of the neighbours' mean has no penalty against the noise of the frame's
    guides, as no denoiser follows. `picture` (H, W, 6 or 7) has samples where `known`
    (H, W).
    """

    def __init__(self, picture: Array, known: Mask) -> None:
        self._guides, self._known = guides_of(picture), known
        # as of one sample: reusing too few samples is a loss here, too
        noise = noise_of_guides(self._guides, 1.0)
        self._variance = box(np.square(noise), _NOISE_AREA)

    def weights(self, passes: Array, seen: Mask) -> Array:
        """Return the weights (H, W) in [0, 1] of neighbours with the given means.

        `passes` (H, W, 6 or 7) are as the frame's own, where they are `seen` (H, W).
        """
        valid = (seen & self._known).astype(np.float32)
        apart = guides_of(passes)
        apart -= self._guides
        apart = np.einsum("ijk,ijk->ij", apart, apart)
        error = _mean(apart, valid, _SMOOTH) - self._variance
        error = np.maximum(error, np.float32(0.0))
        variance = self._variance + np.float32(_BEARABLE**2)
        weight = _mean(variance / (variance + error), valid, _SMOOTH)
        return np.asarray(np.where(self._known, weight, 1.0) * seen, np.float32)


def _variance(difference: Array, texture: Array) -> Array:
    """Return the variance (H, W) of the square root of light, by a local mean.

    Noise is proportional to albedo, so a dark joint between bright stones has little
    noise, whatever surrounds it.
    """
    share = np.square(texture) + np.float32(_EVEN_NOISE)
    near = box(np.square(difference), _NOISE_AREA) / box(share, _NOISE_AREA)
    return np.asarray(near * share + _TINY)


def _mean(x: Array, valid: Array, size: int) -> Array:
    """Return the mean over `size` x `size` pixels of those `valid` (0 or 1)."""
    return np.asarray(box(x * valid, size) / np.maximum(box(valid, size), _TINY))


def _discounted(error: Array, unsure: Array) -> Array:
    """Return an error, reduced where it could be noise."""
    error = np.maximum(error, np.float32(0.0))
    return np.asarray(np.square(error) / (error + unsure + _TINY))
