"""Where more samples pay: parts of a picture, and how many each of them takes.

Two halves of the samples taken so far are denoised at a quarter of the size and
compared as a viewer would see them. Where they differ, the denoiser is still guessing.
The frame is split into few rectangles, for each is a render of its own.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .denoising import Denoiser

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .arrays import Array

SHRINK = 2
"""Pixels along a side of what is compared: quick, and as telling as the full size."""
TILE = 16  # pixels along a side of what is never split
LEAST_SIDE = 2  # tiles: a smaller render is mostly overhead
# Samples are given in proportion to error^(1 / (1 + FALL)). The error of a denoised
# picture falls with samples^0.7; two halves only guess at it, so the rule is gentler.
FALL = 1.2
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

    Both halves together are `taken` samples per pixel; with what is returned the mean
    over the picture is about `samples`, and no pixel has more than `most`. `exposure`
    is the view's, in stops.
    """
    height, width = halves[0].radiance.shape[:2]
    error = _means(_difference(halves, exposure), TILE // SHRINK)[..., 0]
    if not error.any():
        whole = Rectangle(0, 0, width, height)
        return [(whole, samples - taken)] if samples > taken else []
    parts = split(error + FLOOR * error.mean(), rectangles)
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
    """A rectangle of tiles with its mean error."""

    top: int
    bottom: int
    left: int
    right: int
    error: float

    @property
    def area(self) -> int:
        return (self.bottom - self.top) * (self.right - self.left)


def split(error: Array, count: int) -> list[Part]:
    """Split a map of errors (h, w) into at most `count` rectangles.

    Each split is the one after which the samples that are best for every rectangle
    leave the least error: the sum over them of area x error^(1 / (1 + FALL)).
    """
    height, width = error.shape
    whole = Part(0, height, 0, width, float(error.mean()))
    done: list[Part] = []
    queue = [_best_split(error, whole)]
    while queue and len(queue) + len(done) < count:
        gain, part, halves = heapq.heappop(queue)
        if not halves or gain >= 0.0:
            done.append(part)
            continue
        for half in halves:
            heapq.heappush(queue, _best_split(error, half))
    return done + [part for _, part, _ in queue]


def _best_split(error: Array, part: Part) -> tuple[float, Part, tuple[Part, ...]]:
    """Return the change that the best split of a part makes, the part, both halves."""
    best = min(_splits(error, part), key=lambda found: found[0], default=(0.0, ()))
    return best[0], part, best[1]


def _splits(error: Array, part: Part) -> Iterator[tuple[float, tuple[Part, ...]]]:
    top, bottom, left, right, mean = part
    inside = error[top:bottom, left:right]
    before = part.area * mean ** (1 / (1 + FALL))
    for axis in (0, 1):
        length, across = inside.shape[axis], inside.shape[1 - axis]
        at = np.arange(LEAST_SIDE, length - LEAST_SIDE + 1)
        if not at.size:
            continue
        sums = np.cumsum(inside.sum(axis=1 - axis), dtype=np.float64)
        first = sums[at - 1] / (at * across)
        second = (sums[-1] - sums[at - 1]) / ((length - at) * across)
        power = 1 / (1 + FALL)
        after = across * (at * first**power + (length - at) * second**power)
        place = int(np.argmin(after))
        cut, means = int(at[place]), (float(first[place]), float(second[place]))
        yield float(after[place]) - before, _halves(part, axis, cut, means)


def _halves(
    part: Part, axis: int, cut: int, means: tuple[float, float]
) -> tuple[Part, ...]:
    top, bottom, left, right, _ = part
    if axis == 0:
        middle = top + cut
        return (
            Part(top, middle, left, right, means[0]),
            Part(middle, bottom, left, right, means[1]),
        )
    middle = left + cut
    return (
        Part(top, bottom, left, middle, means[0]),
        Part(top, bottom, middle, right, means[1]),
    )


def _counts(parts: Sequence[Part], taken: int, samples: int, most: int) -> list[int]:
    """Samples of every part, in proportion to error^(1 / (1 + FALL)) within bounds."""
    areas = np.array([part.area for part in parts], np.float64)
    wish = np.array([part.error for part in parts]) ** (1 / (1 + FALL))
    low, high = 0.0, most / wish.min()
    for _ in range(60):
        middle = (low + high) / 2
        mean = np.average(np.clip(middle * wish, taken, most), weights=areas)
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
