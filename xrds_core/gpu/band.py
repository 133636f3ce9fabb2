"""Some rows of a frame on a card: buffers, and the order in which kernels fill them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..temporal.accumulate import Means
from ..temporal.changes import TILE
from ..temporal.similarity import MARGIN
from .card import Call
from .step import flagged

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..arrays import Array
    from ..temporal.accumulate import Aligned, Reprojected
    from .target import Target

    Neighbour = Aligned | Reprojected

SUMS_BESIDE = 3
"""Sums of each pixel beside the picture's: weights, samples, brightness."""
_LEVELS = 4  # sizes of areas over which changes are compared


class Band:
    """Rows `first` to `last` (excluded), with the margin that similarity needs."""

    def __init__(self, here: Target, first: int, last: int) -> None:
        height, width = here.frame.shape
        margin = MARGIN + MARGIN % TILE
        start, end = max(first - margin, 0), min(last + margin, height)
        self._here, self._rows = here, (start, end - start)
        self._size = width, end - start
        self._count = width * (end - start)
        self._inner = slice((first - start) * width, (last - start) * width)
        self._channels = here.frame.picture.shape[1]
        self._tiles = -(-width // TILE), -(-(end - start) // TILE)
        empty, tiles = here.card.empty, self._tiles[0] * self._tiles[1]
        self._plain, self._bounds = empty(4 * self._count), empty(4 * self._count)
        self._light, self._taken = empty(2 * self._count), empty(4 * self._count)
        self._areas, self._changes = empty(4 * tiles), empty(tiles)
        self._by_level = empty(4 * _LEVELS * tiles), empty(2 * _LEVELS * tiles)
        self._step = self._uniform(here.step)

    def means(self, groups: Sequence[Sequence[Neighbour]], lit: Sequence[str]) -> Means:
        """Return the means over the band's rows, and of the parts that are `lit`.

        Raises CardLost.
        """
        wide = (self._channels + SUMS_BESIDE) * self._count
        empty = self._here.card.empty
        sums, result = empty(wide * len(groups)), empty(wide)
        factors = empty(self._count * len(groups))
        means = empty((self._channels + 2) * self._count)
        calls = list(self._own())
        lent: list[tuple[int, Neighbour, Any]] = []
        for number, group in enumerate(groups):
            for neighbour in group:
                # those of parts are read again once their weights are known
                taken = empty(4 * self._count) if lit else self._taken
                lent.append((number, neighbour, taken))
                calls += self._gathered(neighbour, number * wide, sums, taken)
        one, two = self._by_level
        calls.append(self._by_tiles("find", {3: one, 4: two, 5: self._changes}))
        calls += self._weighed(len(groups), wide, sums, result, factors)
        here = self._here.buffers
        used = {1: here.picture, 2: here.counts, 3: result, 4: means}
        calls.append(Call("means", "mean", self._size, self._step, used))
        self._here.card.start(calls)
        parts = [self._part(name, lent, factors, result) for name in lit]
        return self._found(self._here.card.download(means), parts)

    def _part(
        self,
        name: str,
        lent: Sequence[tuple[int, Neighbour, Any]],
        factors: Any,
        weights: Any,
    ) -> Array:
        """The mean of one part of the light, (n, 3) of the inner rows."""
        here, card = self._here, self._here.card
        sums, means = card.empty(3 * self._count), card.empty(3 * self._count)
        calls = []
        for number, neighbour, taken in lent:
            part = here.frames.part(neighbour.other, name)
            if part is None:
                continue
            there = here.frames.of(neighbour.other)
            step = flagged(here.step, there_half=there.is_half)
            step["offset"] = number * self._count
            used = {1: part, 2: taken, 3: factors, 4: sums}
            calls.append(Call("parts", "add", self._size, self._uniform(step), used))
        own = here.frames.part(here.frame, name)
        step = self._uniform(flagged(here.step, dark=own is None))
        used = {1: own, 4: sums, 5: here.buffers.counts, 6: weights, 7: means}
        calls.append(Call("parts", "mean", self._size, step, used))
        card.start(calls)
        # a buffer holds four floats at least, a single pixel three
        found = card.download(means)[: 3 * self._count]
        return found.reshape(-1, 3)[self._inner]

    def _own(self) -> Iterator[Call]:
        """What similarity needs to know of the frame itself."""
        here, plain = self._here, self._plain
        used = {1: here.buffers.picture, 2: here.buffers.noise, 4: plain}
        yield Call("own", "unpack", self._size, self._step, used)
        used = {3: here.noise_of_guides, 4: plain, 5: self._bounds, 6: self._light}
        yield Call("own", "prepare", self._size, self._step, used)

    def _gathered(
        self, neighbour: Neighbour, offset: int, sums: Any, taken: Any
    ) -> Iterator[Call]:
        """The samples of a neighbour, added to those of its group."""
        here = self._here
        pair = None if neighbour.pair is None else here.pair(neighbour)
        step = here.step if pair is None else pair.step
        there = here.frames.of(neighbour.other)
        step = flagged(
            step,
            aligned=pair is None,
            there_half=there.is_half,
            there_counts=there.counts is not None,
        )
        step["there_size"] = neighbour.other.shape[::-1]
        step["there_samples"], step["offset"] = neighbour.other.samples, offset
        buffers = (
            here.buffers.depth,
            there.depth,
            there.picture,
            there.noise,
            there.counts,
            pair and pair.extent,
            pair and pair.slots,
            pair and pair.moved,
            pair and pair.masks,
            here.image,
            here.lattice,
            pair and pair.tiles,
            self._light,
            sums,
            taken,
        )
        used = dict(enumerate(buffers, 1))
        yield Call("gather", "gather", self._size, self._uniform(step), used)
        yield self._by_tiles("tile", {1: taken, 2: self._areas})
        one, two = self._by_level
        yield self._by_tiles("add", {2: self._areas, 3: one, 4: two})

    def _by_tiles(self, entry: str, buffers: dict[int, Any]) -> Call:
        return Call("changes", entry, self._tiles, self._step, buffers)

    def _weighed(
        self, groups: int, wide: int, sums: Any, result: Any, factors: Any
    ) -> Iterator[Call]:
        """The sums of all groups, each by its similarity."""
        here, card = self._here, self._here.card
        apart, likeness = card.empty(4 * self._count), card.empty(self._count)
        buffers = (
            here.buffers.picture,
            here.buffers.counts,
            here.noise_of_guides,
            self._plain,
            self._bounds,
            self._changes,
            sums,
            apart,
            likeness,
            result,
            factors,
        )
        for number in range(groups):
            step = flagged(here.step, first_group=number == 0)
            step["offset"] = number * wide
            uniform = self._uniform(step)
            for entry, bindings in _WEIGH.items():
                used = {binding: buffers[binding - 1] for binding in bindings}
                yield Call("weigh", entry, self._size, uniform, used)

    def _uniform(self, step: Any) -> Any:
        step = step.copy()
        step["band"] = self._rows
        return self._here.card.upload(step, uniform=True)

    def _found(self, means: Array, parts: list[Array]) -> Means:
        """The inner rows of what the last kernel has laid one after another."""
        count, inner = self._count, self._inner
        passes = []
        for first in range(0, self._channels, 3):
            width = min(3, self._channels - first)
            plane = means[first * count : (first + width) * count]
            passes.append(plane.reshape(-1, width)[inner])
        samples, reused = means[self._channels * count :].reshape(2, -1)[:, inner]
        if not samples.all():
            nothing = samples[:, None] == 0.0
            passes, parts = (
                [np.where(nothing, np.float32(np.nan), x) for x in planes]
                for planes in (passes, parts)
            )
        return Means(passes, parts, samples, float(reused.sum(dtype=np.float64)))


# Bindings of each kernel of weigh.wgsl, in the order in which they run.
_WEIGH = {
    "compare": (1, 2, 3, 4, 7, 8),
    "compare_light": (5, 8),
    "liken": (5, 6, 8, 9),
    "weigh": (1, 2, 7, 8, 9, 10, 11),
}
