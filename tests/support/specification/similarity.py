"""How far the neighbours show what the frame itself shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.support.specification.filters import (
    Array,
    box,
    least_difference,
    mean,
    total,
)
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.noise import brightness as root_of_luminance
from xrds_core.accumulation.noise import guide_factor, guides_of
from xrds_core.accumulation.weighted_sums import guide_area, penalties

Shape = tuple[int, int]

UNSURE = 6.0
SMOOTH, NOISE_AREA, MEAN, LIGHT_AREA, LIGHT = 3, 7, 3, 5, 4.0
DARKEST_ALBEDO, DARKEST_ROOT, EVEN_NOISE = 0.02, 0.1, 0.1
BEARABLE = 0.03
TILE, AREAS, NEAR, CHANCE = 2, (1, 2, 4, 8), 1, 10.0
TINY = np.float32(1e-9)


def noise_of_guides(guides: Array, samples: float) -> Array:
    """The standard deviation (H, W) of `guides_of` a frame, of all channels."""
    square = np.square(least_difference(guides)).sum(axis=-1)
    return np.sqrt(square * np.float32(2 / 3)) * np.float32(guide_factor(samples))


def discounted(error: Array, unsure: Array) -> Array:
    error = np.maximum(error, 0)
    return error * error / (error + unsure + TINY)


class LightSimilarity:
    """Of frames with radiance; `picture` (H, W, 9 or 10), all else (H, W)."""

    def __init__(
        self,
        frame: Stored,
        picture: Array,
        noise: list[Array],
        known: Array,
        usual: Any,
    ) -> None:
        self.brightness, difference, self.noise = noise
        self.guides, self.known = guides_of(picture[..., 3:]), known
        self.penalties = penalties(frame.samples)
        self.area = guide_area(frame.samples)
        self.unsure = UNSURE * box(self.noise, max(self.area, NOISE_AREA))
        texture = root_of_luminance(picture[..., 3:6])
        share = texture**2 + EVEN_NOISE
        near = box(difference**2, NOISE_AREA) / box(share, NOISE_AREA)
        self.variance = near * share + TINY
        self.chance = box(difference, MEAN) ** 2
        albedo = box(np.square(self.guides[..., :3]).sum(axis=-1), SMOOTH)
        light = box(self.brightness, SMOOTH)
        self.light_for_albedo = (light**2 / 4 + DARKEST_ALBEDO * usual) / (
            albedo + DARKEST_ALBEDO
        )
        self.light = light / (box(texture, SMOOTH) + DARKEST_ROOT)
        self.untextured = self.brightness - self.light * texture
        self.neighbours: list[tuple[Array, Array, Array]] = []

    def add(
        self, picture: Array, brightness: Array, difference: Array, weight: Array
    ) -> None:
        """Add what a neighbour shows, whichever its group."""
        light = brightness - self.light * root_of_luminance(picture[..., 3:6])
        self.neighbours.append((light - self.untextured, difference, weight))

    def weights(self, passes: Array, brightness: Array, seen: Array) -> Array:
        """The weights of neighbours with these means, where they are `seen`."""
        valid = (seen & self.known).astype(np.float32)
        apart = np.square(guides_of(passes) - self.guides).sum(axis=-1) - self.noise
        error = discounted(mean(apart, valid, self.area), self.unsure)
        error = self.penalties[0] * self.light_for_albedo * error
        apart = box((self.brightness - brightness) * valid, MEAN) ** 2 - self.chance
        unsure = UNSURE / MEAN**2 * self.variance
        error += LIGHT * discounted(box(apart, LIGHT_AREA), unsure)
        error += self.penalties[1] * changes(self.neighbours, self.known.shape)
        like = mean(self.variance / (self.variance + error), valid, SMOOTH)
        return np.where(self.known, like, 1.0) * seen


class GuideSimilarity:
    """Of frames of guides alone; `picture` (H, W, 6 or 7)."""

    def __init__(self, picture: Array, known: Array) -> None:
        self.guides, self.known = guides_of(picture), known
        self.variance = box(noise_of_guides(self.guides, 1.0) ** 2, NOISE_AREA)

    def add(self, *_: Array) -> None:
        """Guides change with what they show alone."""

    def weights(self, passes: Array, _: Array, seen: Array) -> Array:
        valid = (seen & self.known).astype(np.float32)
        apart = np.square(guides_of(passes) - self.guides).sum(axis=-1)
        error = np.maximum(mean(apart, valid, SMOOTH) - self.variance, 0)
        variance = self.variance + BEARABLE**2
        like = mean(variance / (variance + error), valid, SMOOTH)
        return np.where(self.known, like, 1.0) * seen


def changes(neighbours: list[tuple[Array, Array, Array]], shape: Shape) -> Array:
    """The squared error of light that changes, summed over areas of all sizes."""
    error = np.zeros((-(-shape[0] // TILE), -(-shape[1] // TILE)), np.float32)
    for size in AREAS if neighbours else ():
        before, after = (size - 1) // 2, size - 1 - (size - 1) // 2
        sums = [
            [
                total(_tiles(x), before, after)
                for x in (weight, weight * light, np.square(weight * noise))
            ]
            for light, noise, weight in neighbours
        ]
        error += _variance(*np.moveaxis(np.array(sums, np.float32), 0, 1))
    wide = error.repeat(TILE, axis=0).repeat(TILE, axis=1)
    return wide[: shape[0], : shape[1]]


def _variance(weight: Array, light: Array, chance: Array) -> Array:
    """Between neighbours (n, H, W) of tiles, beyond that of their noise."""
    share = 1 / np.maximum(weight, TINY)
    every = 1 / np.maximum(weight.sum(0), TINY)
    varies = (light**2 * share).sum(0) - light.sum(0) ** 2 * every
    noise = (chance * share).sum(0) - chance.sum(0) * every
    free = weight.sum(0) - (weight**2).sum(0) * every
    free = np.maximum(total(free, NEAR, NEAR), TINY)
    variance = np.maximum(total(varies - noise, NEAR, NEAR) / free, 0)
    noise = CHANCE * np.maximum(total(noise, NEAR, NEAR) / free, 0)
    return variance**2 / (variance + noise + TINY)


def _tiles(x: Array) -> Any:
    """The sums over tiles of (H, W), padded to whole tiles."""
    wide = np.pad(x, ((0, -x.shape[0] % TILE), (0, -x.shape[1] % TILE)))
    return sum(wide[i::TILE, j::TILE] for i in range(TILE) for j in range(TILE))
