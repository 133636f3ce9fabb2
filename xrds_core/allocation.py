"""Where more samples pay: parts of a picture, and how many each of them takes.

Two halves of the samples taken so far are denoised at a quarter of the size and
compared as a viewer would see them. Where they differ, the denoiser is still guessing.
What is held is the seconds, not the rays: a ray that meets nothing costs little. The
frame is split into few rectangles, for each is a render of its own. All of it follows
from the pixels alone, so the same scene gives the same picture again.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .denoising import Denoiser

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .arrays import Array

SHRINK = 2
"""Pixels along a side of what is compared: quick, and as telling as the full size."""
TILE = 16  # pixels along a side of what is never split
LEAST_SIDE = 2  # tiles: a smaller render is mostly overhead
# Samples are given in proportion to (error / cost)^POWER, which is best where the error
# falls with samples^(1 / POWER - 1). That of a denoised picture does with samples^0.7;
# two halves only guess at it, so the rule is gentler.
POWER = 0.45
MISS_COST = 0.15  # of a sample that meets nothing, over that of others
FLOOR = 0.1  # of the mean error, for what two halves cannot tell


class Rectangle(NamedTuple):
    """A part of a picture in pixels, from its top-left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Half:
    """Means of one half of the samples: each float32 (H, W, 3)."""

    radiance: Array
    albedo: Array
    normal: Array

    def shrunk(self) -> Half:
        """At 1/SHRINK of the size; rows and columns that are left over are cut."""
        return Half(*(_means(x, SHRINK) for x in vars(self).values()))


def allot(
    halves: Sequence[Half],
    taken: int,
    samples: int,
    most: int,
    exposure: float,
    rectangles: int = 32,
) -> list[tuple[Rectangle, int]]:
    """Return at most so many rectangles, and how many more samples a pixel there takes.

    Both halves together are `taken` samples per pixel; with what is returned they cost
    about as much as `samples` everywhere, and no pixel has more than `most`. `exposure`
    is the view's, in stops.
    """
    height, width = halves[0].radiance.shape[:2]
    error = _means(_difference(halves, exposure), TILE // SHRINK)[..., 0]
    if not error.any():
        whole = Rectangle(0, 0, width, height)
        return [(whole, samples - taken)] if samples > taken else []
    parts = split(error + FLOOR * error.mean(), _costs(halves), rectangles)
    counts = _counts(parts, taken, samples, most)
    edges = _Edges(width, height, error.shape)
    return [
        (edges.pixels(part), count - taken)
        for part, count in zip(parts, counts, strict=True)
        if count > taken
    ]


def _difference(halves: Sequence[Half], exposure: float) -> Array:
    """Squared difference of the denoised halves as shown, (h, w, 1), shrunk."""
    denoiser = _denoiser()
    shown = [
        _shown(denoiser(*vars(half.shrunk()).values()).radiance, exposure)
        for half in halves
    ]
    return np.mean(np.square(shown[0] - shown[1]), axis=-1, keepdims=True)


@lru_cache(maxsize=1)
def _denoiser() -> Denoiser:
    return Denoiser("fast", "cpu")


def _costs(halves: Sequence[Half]) -> Array:
    """What a sample costs in every tile, of one that meets a surface."""
    meets = np.any([half.normal.any(axis=-1, keepdims=True) for half in halves], axis=0)
    small = _means(meets.astype(np.float32), SHRINK)
    share = _means(small, TILE // SHRINK)[..., 0]
    return MISS_COST + (1.0 - MISS_COST) * share


def _shown(radiance: Array, exposure: float) -> Array:
    """About as a view transform shows it: bright parts count less, none for nothing."""
    light = np.maximum(radiance, 0.0) * np.float32(2.0**exposure)
    return (light / (1.0 + light)) ** np.float32(1 / 2.2)


def _means(x: Array, side: int) -> Array:
    """Means of blocks of `side` pixels, (H, W, C) -> (H // side, W // side, C)."""
    height, width = (max(size // side, 1) for size in x.shape[:2])
    x = x[: height * side, : width * side]
    rows, columns = x.shape[0] // height, x.shape[1] // width
    return x.reshape(height, rows, width, columns, -1).mean(axis=(1, 3))


# --- splitting ------------------------------------------------------------------------


class Part(NamedTuple):
    """A rectangle of tiles with its mean error and the mean cost of a sample."""

    top: int
    bottom: int
    left: int
    right: int
    error: float
    cost: float

    @property
    def area(self) -> int:
        return (self.bottom - self.top) * (self.right - self.left)


def split(error: Array, cost: Array, count: int) -> list[Part]:
    """Split maps of errors and of a sample's cost (h, w) into at most `count` parts.

    Each split is the one after which the samples that are best for every part leave
    the least error: the sum of area x error^POWER x cost^(1 - POWER) over them.
    """
    height, width = error.shape
    maps: Any = np.stack((error, cost)).astype(np.float64)
    whole = Part(0, height, 0, width, *(float(x.mean()) for x in maps))
    done: list[Part] = []
    queue = [_best_split(maps, whole)]
    while queue and len(queue) + len(done) < count:
        gain, part, halves = heapq.heappop(queue)
        if not halves or gain >= 0.0:
            done.append(part)
            continue
        for half in halves:
            heapq.heappush(queue, _best_split(maps, half))
    return done + [part for _, part, _ in queue]


def _best_split(maps: Any, part: Part) -> tuple[float, Part, tuple[Part, ...]]:
    """Return the change that the best split of a part makes, the part, both halves."""
    found = _splits(maps, part)
    best = min(found, key=lambda each: each[0], default=(0.0, ()))
    return best[0], part, best[1]


def _splits(maps: Any, part: Part) -> Iterator[tuple[float, tuple[Part, ...]]]:
    inside = maps[:, part.top : part.bottom, part.left : part.right]
    before = part.area * _weight(part.error, part.cost)
    for axis in (0, 1):
        length, across = inside.shape[1 + axis], inside.shape[2 - axis]
        at = np.arange(LEAST_SIDE, length - LEAST_SIDE + 1)
        if not at.size:
            continue
        sums = np.cumsum(inside.sum(axis=2 - axis), axis=1)
        first = sums[:, at - 1] / (at * across)
        second = (sums[:, -1:] - sums[:, at - 1]) / ((length - at) * across)
        after = across * (at * _weight(*first) + (length - at) * _weight(*second))
        place = int(np.argmin(after))
        means = [[float(x) for x in half[:, place]] for half in (first, second)]
        yield float(after[place]) - before, _halves(part, axis, int(at[place]), means)


def _weight(error: Any, cost: Any) -> Any:
    return error**POWER * cost ** (1 - POWER)


def _halves(
    part: Part, axis: int, cut: int, means: Sequence[Sequence[float]]
) -> tuple[Part, ...]:
    top, bottom, left, right = part[:4]
    if axis == 0:
        middle = top + cut
        sides = ((top, middle, left, right), (middle, bottom, left, right))
    else:
        middle = left + cut
        sides = ((top, bottom, left, middle), (top, bottom, middle, right))
    return tuple(Part(*side, *mean) for side, mean in zip(sides, means, strict=True))


def _counts(parts: Sequence[Part], taken: int, samples: int, most: int) -> list[int]:
    """Samples of every part, in proportion to (error / cost)^POWER within bounds."""
    costs = np.array([part.area * part.cost for part in parts])
    wish = np.array([part.error / part.cost for part in parts]) ** POWER
    low, high = 0.0, most / wish.min()
    for _ in range(60):
        middle = (low + high) / 2
        mean = np.average(np.clip(middle * wish, taken, most), weights=costs)
        low, high = (middle, high) if mean < samples else (low, middle)
    return [int(n) for n in np.rint(np.clip(low * wish, taken, most))]


class _Edges:
    """From tiles to pixels: the last ones reach to the picture's edge."""

    def __init__(self, width: int, height: int, tiles: tuple[int, ...]) -> None:
        self._size, self._tiles = (height, width), tiles

    def pixels(self, part: Part) -> Rectangle:
        y, bottom = (self._pixel(edge, 0) for edge in (part.top, part.bottom))
        x, right = (self._pixel(edge, 1) for edge in (part.left, part.right))
        return Rectangle(x, y, right - x, bottom - y)

    def _pixel(self, edge: int, axis: int) -> int:
        return self._size[axis] if edge == self._tiles[axis] else edge * TILE
