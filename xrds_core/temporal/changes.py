"""Light that changes from frame to frame, detected where neighbours differ.

The noise of one frame hides that a shadow has moved. All its neighbours together have
many times its samples. Where they vary by more than their noise, the frame itself is as
far from their mean.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..arrays import Array

TILE = 2  # pixels across: light is compared tile by tile
REACH = 11  # pixels on each side of one that influence its result
_AREAS = (1, 2, 4, 8)  # tiles across: light is averaged before it is compared
_NEAR = 3  # tiles across, over which variances are averaged
# Weight of noise against the variance beyond it. The variance of nine frames is off by
# a third, which must not cost the samples they add; real changes are many times the
# noise of an area.
_CHANCE = 10.0
_TINY = np.float32(1e-9)


class Changes:
    """Accumulates the light of a frame's neighbours and its variance.

    All arrays are (H, W).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        tiles = (-(-shape[0] // TILE), -(-shape[1] // TILE))
        self._sums = {size: _Sums(tiles) for size in _AREAS}

    def add(self, light: Array, noise: Array, weight: Array) -> None:
        """Add a neighbour's light, its noise and the weight of each pixel.

        `noise` is the square root of an estimate of the light's variance.
        """
        parts = [_tiles(x) for x in (weight, weight * light, np.square(weight * noise))]
        for size, sums in self._sums.items():
            sums.add(*(_pooled(x, size) for x in parts))

    def error(self) -> Array:
        """Return the squared error due to changes, summed over areas of all sizes.

        It is reduced where it could be noise.
        """
        error = np.sum([sums.variance() for sums in self._sums.values()], axis=0)
        wide = error.repeat(TILE, axis=0).repeat(TILE, axis=1)
        return np.asarray(wide[: self._shape[0], : self._shape[1]])


class _Sums:
    """Sums over the neighbours, for areas of one size; arrays are (H, W) of tiles."""

    def __init__(self, tiles: tuple[int, int]) -> None:
        self._weight, self._weight2, self._light, self._light2 = np.zeros(
            (4, *tiles), np.float32
        )
        self._chance, self._chance2 = np.zeros((2, *tiles), np.float32)

    def add(self, weight: Array, light: Array, chance: Array) -> None:
        """`light` is weighted, `chance` its variance, weighted twice."""
        share = np.float32(1.0) / np.maximum(weight, _TINY)
        self._weight += weight
        self._weight2 += np.square(weight)
        self._light += light
        self._light2 += np.square(light) * share
        self._chance += chance
        self._chance2 += chance * share

    def variance(self) -> Array:
        """Return the variance between neighbours beyond that of their noise."""
        share = np.float32(1.0) / np.maximum(self._weight, _TINY)
        varies = self._light2 - np.square(self._light) * share
        chance = self._chance2 - self._chance * share
        free = self._weight - self._weight2 * share
        free = np.maximum(_pooled(free, _NEAR), _TINY)
        variance = np.maximum(_pooled(varies - chance, _NEAR) / free, np.float32(0.0))
        chance = np.maximum(_pooled(chance, _NEAR) / free, np.float32(0.0))
        chance *= np.float32(_CHANCE)
        return np.asarray(np.square(variance) / (variance + chance + _TINY))


def _tiles(x: Array) -> Array:
    """Return the sums over tiles of (H, W), padded to whole tiles."""
    height, width = x.shape
    if height % TILE or width % TILE:
        x = np.pad(x, ((0, -height % TILE), (0, -width % TILE)))
    rows = _added([x[i::TILE] for i in range(TILE)])
    return _added([rows[:, i::TILE] for i in range(TILE)])


def _pooled(x: Array, size: int) -> Array:
    """Return the sums over `size` x `size` tiles around each of (H, W)."""
    if size == 1:
        return x
    before = (size - 1) // 2
    wide = np.pad(x, (before, size - 1 - before))
    rows = _added([wide[i : i + x.shape[0]] for i in range(size)])
    return _added([rows[:, i : i + x.shape[1]] for i in range(size)])


def _added(parts: Sequence[Array]) -> Array:
    total = parts[0] + parts[1]
    for part in parts[2:]:
        total += part
    return np.asarray(total)
