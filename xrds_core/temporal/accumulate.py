"""Accumulates the noisy samples of neighbour frames on the pixels of one frame.

Samples are gathered, never interpolated: each pixel takes the nearest pixel of the
neighbour frame. Interpolation would correlate the noise of adjacent pixels, and
denoisers mistake correlated noise for texture. How far that pixel lies from the true
place is taken out by `registration`, for which a frame is gathered twice. The mean is
weighted by sample counts, by what distance remains, which keeps fine texture sharp, and
by a similarity weight: do both frames show the same light?
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..errors import PictureError
from .candidates import Images, find_images
from .coarse_rejection import pixel_weights, tile_weights
from .half_floats import floats
from .local_filters import extreme
from .motion import FEW_SAMPLES, grid, inverse_depth_range, pair, places
from .registration import AS_DISTANCE, MOMENTS, Guess, moments
from .shot_cuts import same_shot
from .similarity import MARGIN, GuideSimilarity, Similarity, light_for_albedo
from .vectors import Movement

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored
    from .motion import Pair, Places

    Mask = NDArray[np.bool_]

Item = TypeVar("Item")
Result = TypeVar("Result")
# Standard deviation, in pixels, of the weight by distance where frames have one sample
# per pixel; it falls with their cube root. Noise calls for a wide one, texture for a
# narrow one: 0.7 and 0.6 were best at 1 and 2 samples, 0.2 to 0.3 at 16.
_SOFTNESS = 0.7
_ROWS = 128  # at a time, plus the margin of the similarity weight
_TINY = np.float32(1e-9)


@dataclass(frozen=True)
class Accumulated:
    """A frame with the samples of its neighbour frames; float32, (H, W, 3) or (H, W).

    `radiance` (None of guides alone), `albedo`, `normal` (in this frame's axes) and
    `alpha` (or None) are means over `samples` (H, W) samples per pixel, NaN where no
    frame has any. So are `parts` of the radiance, by name.
    `rejected` is the share of the neighbours' samples that were left out: of pixels
    that a neighbour does not show, or shows in other light. `frames` are the numbers of
    the frames that were considered, the frame itself included: those of its shot,
    between two shot cuts.
    """

    radiance: Array | None
    albedo: Array
    normal: Array
    alpha: Array | None
    samples: Array
    rejected: float
    frames: tuple[int, ...]
    parts: Mapping[str, Array] = field(default_factory=dict)


def accumulate(
    target: Stored,
    others: Sequence[Stored],
    movement: Movement | None = None,
    threads: int | None = None,
) -> Accumulated:
    """Return `target` with the samples of `others`.

    `movement` caches the object motion of this shot; without it each call computes it
    again. No samples are reused across a shot cut. Without others the result is
    bit-identical to the target. `threads`: all processors by default; the result does
    not depend on it. Raises PictureError where the frames hold different passes.
    """
    others = same_shot(target, others)
    groups = _neighbours(target, others, movement or Movement(), threads)
    usual = light_for_albedo(target) if others and target.has_light else 0.0
    pairs = [x.pair for group in groups for x in group if x.pair and x.is_reused]
    images = find_images(target, pairs, partial(_in_threads, threads=threads))
    lit = _lit(target, others)
    # G's own noise counts more than texture where samples are few
    registers = bool(pairs) and target.samples > FEW_SAMPLES
    gather = partial(
        _by_rows, target, images=images, usual=usual, lit=lit, threads=threads
    )
    guess = None
    if registers:
        near = gather(groups[:1])
        guess = Guess([*near.passes, *near.parts], target.has_light)
    means = gather(groups, guess=guess)
    height, width = target.shape
    requested = sum(x.samples for x in others) * height * width
    rejected = 1.0 - means.reused / requested if requested else 0.0
    frames = tuple(sorted({target.number, *(x.number for x in others)}))
    return _unpacked(target, means, lit, rejected, frames)


@dataclass(frozen=True)
class Means:
    """Means over a frame's own and the samples that it reuses.

    `passes` of the picture, each (H, W, C), `parts` that are lit (H, W, 3), `samples`
    (H, W), and how many samples were `reused` in all.
    """

    passes: list[Array]
    parts: list[Array]
    samples: Array
    reused: float


def _by_rows(
    target: Stored,
    groups: Sequence[Sequence[Aligned | Reprojected]],
    images: Images | None,
    usual: float,
    lit: tuple[str, ...],
    threads: int | None,
    guess: Guess | None = None,
) -> Means:
    """Accumulate block by block."""
    height, width = target.shape
    means = np.empty((height * width, target.picture.shape[1]), np.float32)
    parts = np.empty((height * width, 3 * len(lit)), np.float32)
    samples = np.empty(height * width, np.float32)

    def work(first: int) -> float:
        rows = slice(first, min(first + _ROWS, height))
        block = _Block(target, rows, usual, images, lit, guess is not None)
        sums = [_block_sums(block, group) for group in groups if group]
        if guess is not None:
            changes = guess.changes(block.rows, [each.moments for each in sums])
            for each, change in zip(sums, changes, strict=True):
                each.register(change)
        for each in sums:
            each.finish()
        found = _means(target, block, sums)
        means[block.pixels], parts[block.pixels], samples[block.pixels] = found
        return float(sum(each.reused.sum(dtype=np.float64) for each in sums))

    reused = sum(_in_threads(work, range(0, height, _ROWS), threads))
    passes, light = _planes(target, means), _planes(target, parts)
    return Means(passes, light, samples.reshape(target.shape), reused)


def _lit(target: Stored, others: Sequence[Stored]) -> tuple[str, ...]:
    """Return the names of the parts that any of the frames has light in."""
    frames = (target, *others)
    return tuple(
        name
        for name in target.parts
        if any(frame.parts.get(name) is not None for frame in frames)
    )


def _neighbours(
    target: Stored,
    others: Sequence[Stored],
    movement: Movement,
    threads: int | None,
) -> tuple[list[Aligned | Reprojected], list[Aligned | Reprojected]]:
    """Return the neighbours in two groups: the nearest ones, and those farther away."""
    rest = [x for x in others if not target.shows_same(x)]
    motions = dict(
        zip(map(id, rest), movement.object_motions(target, rest), strict=True)
    )
    depth_range = inverse_depth_range(target) if rest else None
    near = _nearest(target, others)

    def neighbour(other: Stored) -> Aligned | Reprojected:
        if id(other) not in motions:
            return Aligned(other)
        return Reprojected(pair(target, other, motions[id(other)], depth_range))

    groups: tuple[list[Aligned | Reprojected], list[Aligned | Reprojected]] = ([], [])
    for found in _in_threads(neighbour, others, threads):
        groups[found.other.number not in near].append(found)
    return groups


def _nearest(target: Stored, others: Sequence[Stored]) -> set[int]:
    """Return the numbers of the frames just before and after, and the frame's own."""
    before = [x.number for x in others if x.number < target.number]
    after = [x.number for x in others if x.number > target.number]
    return {target.number, *sorted(before)[-1:], *sorted(after)[:1]}


class _Block:
    """Some rows of the target, with the margin that the similarity weight needs.

    `usual` is as in `Similarity`. `void` (n,) marks where a frame with alpha is
    transparent, in a pixel or next to it: there is no noise to remove, and an outline
    accumulated from several frames is wider than that of one. Where the block
    `registers` the moments of offsets are summed.
    """

    def __init__(
        self,
        target: Stored,
        rows: slice,
        usual: float,
        images: Images | None,
        lit: tuple[str, ...] = (),
        registers: bool = False,
    ) -> None:
        height, width = target.shape
        first, last = max(rows.start - MARGIN, 0), min(rows.stop + MARGIN, height)
        self.rows = slice(first, last)
        self.pixels = slice(rows.start * width, rows.stop * width)
        self.wide = grid(target.shape, first, last)
        start = self.pixels.start - first * width
        self.inner = slice(start, start + self.pixels.stop - self.pixels.start)
        self.own = floats(target.picture[self.wide.pixels])
        self.lit = lit
        self.parts = self.parts_of(target, self.wide.pixels)
        self.images = None if images is None else images.of(self.wide)
        self.void = self._void()
        self.known = np.ones(len(self.own), bool)
        if target.invalid is not None:
            self.known = ~target.invalid[self.wide.pixels]
        self.registers = registers
        self._target, self._usual = target, usual

    @cached_property
    def similarity(self) -> Similarity | None:
        """The similarity weights; None where there is no light to compare."""
        if not self._target.has_light:
            return None
        return _similarity(self._target, self, self._usual)

    def _void(self) -> Mask | None:
        if not self.own.shape[1] % 3:
            return None
        least = extreme(self.shaped(self.own[:, -1]), np.fmin)
        return np.asarray(least.ravel() == 0.0)

    def parts_of(self, frame: Stored, pixels: slice | NDArray[np.integer]) -> Array:
        """As many flat pixels (n, 3 P) of a frame's parts, of those lit anywhere."""
        found = np.zeros((len(self.own), 3 * len(self.lit)), np.float32)
        for number, name in enumerate(self.lit):
            part = frame.parts[name]
            if part is not None:
                found[:, 3 * number : 3 * number + 3] = floats(part[pixels])
        return found

    def shaped(self, x: NDArray[Any]) -> NDArray[Any]:
        """The rows (n, ...) as (H, W, ...)."""
        return x.reshape(self.rows.stop - self.rows.start, -1, *x.shape[1:])


def _similarity(target: Stored, block: _Block, usual: float) -> Similarity:
    noise, pixels = target.noise, block.wide.pixels
    assert noise is not None
    parts = (noise.brightness, noise.difference, noise.guides)
    brightness, difference, guides = (block.shaped(floats(x[pixels])) for x in parts)
    return Similarity(
        block.shaped(block.own),
        brightness,
        difference,
        np.square(guides),
        block.shaped(block.known),
        target.samples,
        usual,
    )


class _Sums:
    """The samples of some neighbours, summed over the rows of a block and its margin.

    `values` (n, C), `parts` (n, 3 P), `brightness` (n,) and `moments` (MOMENTS, n) are
    weighted sums, `weights` (n,) the sums of weights, `reused` (n,) the numbers of
    samples.
    """

    def __init__(self, block: _Block) -> None:
        self.block = block
        self.values, self.parts = np.zeros_like(block.own), np.zeros_like(block.parts)
        self.moments = np.zeros((MOMENTS, len(block.own)), np.float32)
        self.weights, self.reused, self.brightness = np.zeros(
            (3, len(block.own)), np.float32
        )

    def add(
        self,
        values: Array,
        parts: Array,
        weight: Array,
        reused: Array,
        noise: tuple[Array, ...],
    ) -> None:
        """Add those of one neighbour; `noise` is as `_noise` returns it."""
        if self.block.similarity is not None:
            self.brightness += noise[0] * weight
            self.block.similarity.add(*map(self.block.shaped, (values, *noise, weight)))
        values *= weight[:, None]
        self.values += values
        parts *= weight[:, None]
        self.parts += parts
        self.weights += weight
        self.reused += reused

    def register(self, change: Array) -> None:
        """Take out the offsets of the pixels taken: add a change as `Guess` has it."""
        channels = self.values.shape[1]
        self.values += change[:, :channels]
        self.parts += change[:, channels:][:, : self.parts.shape[1]]
        if self.block.similarity is not None:
            self.brightness += change[:, -1]

    def finish(self) -> None:
        """Apply the similarity weight and crop to the block's own rows."""
        block = self.block
        weights = np.maximum(self.weights, _TINY)
        means = block.shaped(self.values / weights[:, None])
        seen = block.shaped(self.weights > 0.0)
        if block.similarity is not None:
            root = block.shaped(self.brightness / weights)
            similarity = block.similarity.weights(means[..., 3:], root, seen)
        else:
            own, known = block.shaped(block.own), block.shaped(block.known)
            similarity = GuideSimilarity(own, known).weights(means, seen)
        self._scale(similarity.ravel())
        if block.void is not None:
            self._scale((~block.void).astype(np.float32))
        inner = block.inner
        self.values, self.parts = self.values[inner], self.parts[inner]
        self.weights, self.reused = self.weights[inner], self.reused[inner]

    def _scale(self, factor: Array) -> None:
        self.values *= factor[:, None]
        self.parts *= factor[:, None]
        self.weights *= factor
        self.reused *= factor


def _block_sums(block: _Block, neighbours: Sequence[Aligned | Reprojected]) -> _Sums:
    """Return the sums of a group of neighbours over a block."""
    sums = _Sums(block)
    for neighbour in neighbours:
        neighbour.add(block, sums)
    return sums


def _noise(
    other: Stored, pixels: slice | NDArray[np.integer], block: _Block
) -> tuple[Array, ...]:
    """Return brightness and difference (n,) of flat pixels; () where not needed."""
    if block.similarity is None or other.noise is None:
        return ()
    noise = other.noise
    return tuple(floats(x[pixels]) for x in (noise.brightness, noise.difference))


class Aligned:
    """A neighbour that shows the same in every pixel: no reprojection is needed."""

    pair = None

    def __init__(self, other: Stored) -> None:
        self.other = other

    def add(self, block: _Block, sums: _Sums) -> None:
        """As `Reprojected.add`."""
        other, pixels = self.other, block.wide.pixels
        weight = sample_counts(other, pixels, len(block.own))
        if other.invalid is not None:
            weight[other.invalid[pixels]] = 0.0
        # a copy: NumPy's own float32 pictures are not to be changed
        values = floats(other.picture[pixels]).copy()
        parts = block.parts_of(other, pixels)
        sums.add(values, parts, weight, weight, _noise(other, pixels, block))


class Reprojected:
    """A neighbour whose pixels are found by reprojection and weighted.

    `tiles` are its weights by coarse rejection; `fall` times the squared distance is
    the logarithm of a weight.
    """

    def __init__(self, pair: Pair) -> None:
        target, other = pair.here, pair.there
        if (other.picture.shape[1], other.parts.keys()) != (
            target.picture.shape[1],
            target.parts.keys(),
        ):
            raise PictureError(
                f"frame {other.number} and frame {target.number} hold different passes:"
                " give radiance, its parts and alpha for all frames of a shot or for "
                "none"
            )
        self.tiles = tile_weights(pair)
        self.pair, self.other = pair, other
        self.fall = np.float32(-0.5 * target.samples ** (2 / 3) / _SOFTNESS**2)

    @property
    def is_reused(self) -> bool:
        """Whether any of its tiles is."""
        return bool(self.tiles.any())

    def add(self, block: _Block, sums: _Sums) -> None:
        """Add its samples that the pixels of a block reuse."""
        other = self.other
        if not self.is_reused:
            return
        found = places(self.pair, block.wide)
        tiles = pixel_weights(self.tiles, self.pair.here.shape, block.rows).ravel()
        if block.images is not None:
            found.put(block.images.at, block.images.places(self.pair))
            # tiles compare surfaces; light that changes everywhere leaves none of them
            tiles[block.images.at] = self.tiles.max()
        if other.invalid is not None:
            found.seen[...] &= ~other.invalid.take(found.pixel)
        values = floats(other.picture.take(found.pixel, axis=0))
        if (turn := self.pair.turn) is not None:
            values[:, other.normals] = values[:, other.normals] @ turn.T
        weight = found.seen.astype(np.float32)
        weight *= tiles
        weight *= sample_counts(other, found.pixel, len(weight))
        reused = weight.copy()
        if not block.registers:
            weight *= np.exp(found.apart * self.fall)
        else:
            x, y = self._offsets(found, block)
            less = (x * x + y * y) * np.float32(1.0 - AS_DISTANCE)
            weight *= np.exp((found.apart - less) * self.fall)
            sums.moments += moments(x, y, weight)
        parts = block.parts_of(other, found.pixel)
        sums.add(values, parts, weight, reused, _noise(other, found.pixel, block))

    def _offsets(self, found: Places, block: _Block) -> tuple[Array, Array]:
        """Return the offsets (n,) that can be taken out; 0 elsewhere.

        Beside a nearer surface what a pixel mixes moves in two ways.
        """
        beside = self.pair.here.rims[block.wide.pixels]
        beside = beside | self.other.rims.take(found.pixel)
        inner = found.seen & ~beside
        return found.x * inner, found.y * inner


def sample_counts(
    frame: Stored, pixels: slice | NDArray[np.integer], count: int
) -> Array:
    """Return the sample counts of flat pixels (n,) of a frame."""
    if frame.counts is None:
        return np.full(count, frame.samples, np.float32)
    return floats(frame.counts[pixels]).copy()


def _means(
    target: Stored, block: _Block, groups: Sequence[_Sums]
) -> tuple[Array, Array, Array]:
    """Return means of the target's own and the reused samples, of the picture and of
    its parts, and the number of samples.
    """
    own, parts = block.own[block.inner], block.parts[block.inner]
    samples = sample_counts(target, block.pixels, len(own))
    if target.invalid is not None:
        samples[target.invalid[block.pixels]] = 0.0
    if not groups:
        has_samples = samples[:, None] > 0.0
        nothing = np.float32(np.nan)
        return (
            np.where(has_samples, own, nothing),
            np.where(has_samples, parts, nothing),
            samples,
        )
    weights = np.sum([group.weights for group in groups], axis=0)
    total = samples + weights

    def mean(own: Array, sums: Array) -> Array:
        sums -= own * weights[:, None]
        with np.errstate(invalid="ignore"):  # NaN where no frame has samples
            sums /= total[:, None]
        # in this form nothing is rounded where nothing is reused
        return own + sums

    picture = mean(own, np.sum([group.values for group in groups], axis=0))
    return picture, mean(parts, np.sum([x.parts for x in groups], axis=0)), total


def _unpacked(
    target: Stored,
    means: Means,
    lit: tuple[str, ...],
    rejected: float,
    frames: tuple[int, ...],
) -> Accumulated:
    passes = list(means.passes)
    alpha = passes.pop()[..., 0] if target.picture.shape[1] % 3 else None
    *radiance, albedo, normal = passes
    light = dict(zip(lit, means.parts, strict=True))
    dark = np.zeros((*target.shape, 3), np.float32)
    return Accumulated(
        radiance[0] if radiance else None,
        albedo,
        normal,
        alpha,
        means.samples,
        rejected,
        frames,
        {name: light.get(name, dark) for name in target.parts},
    )


def _planes(target: Stored, values: Array) -> list[Array]:
    """Split (H W, C) into (H, W, 3), the last one narrower where C is no multiple."""
    places = (slice(first, first + 3) for first in range(0, values.shape[1], 3))
    return [
        np.ascontiguousarray(values[:, place]).reshape(*target.shape, -1)
        for place in places
    ]


def _in_threads(
    work: Callable[[Item], Result], items: Sequence[Item], threads: int | None
) -> list[Result]:
    """Run `work` on every item; NumPy releases the GIL in all that takes long here."""
    count = min(threads or os.cpu_count() or 1, len(items))
    with ThreadPoolExecutor(max(count, 1)) as pool:
        return list(pool.map(work, items))
