"""The noisy samples of other frames on the pixels of one: gathered, never interpolated.

Each pixel takes the other frame's nearest pixel as it is. Interpolation would correlate
the noise of neighbouring pixels, and denoisers take correlated noise for texture. The
mean is weighted by sample counts, by how near the pixel taken lies to the true place,
which keeps fine texture sharp, and by whether both frames show the same light.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import PictureError
from .judge import MARGIN, GuideJudge, Judge, light_for_albedo
from .motion import grid, pair, places, surroundings
from .neighbours import extreme
from .survey import spread, survey
from .takes import same_take
from .vectors import Movement

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Camera, Matrix, Stored
    from .motion import Pair

    Mask = NDArray[np.bool_]

# Standard deviation, in pixels, of the weight by distance where frames have one sample
# per pixel; it falls with their cube root. Noise asks for a wide one, texture for a
# narrow one: 0.7 and 0.6 were best at 1 and 2 samples, 0.2 to 0.3 at 16.
_SOFTNESS = 0.7
_ROWS = 128  # at a time, with the margin of the judge
_TINY = np.float32(1e-9)
# Every half float, by its bits.
_HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)


@dataclass(frozen=True)
class Accumulated:
    """A frame with the samples of its neighbours; float32, (H, W, 3) or (H, W).

    `radiance` (None of guides alone), `albedo`, `normal` (in this frame's axes) and
    `alpha` (or None) are means over `samples` (H, W) samples per pixel, NaN where no
    frame has any.
    `rejected` is the share of the neighbours' samples that were left out: pixels that
    no neighbour shows, or that show other light. `frames` are the numbers of those
    that were asked, the frame's own too: the frames of its take, between two cuts.
    """

    radiance: Array | None
    albedo: Array
    normal: Array
    alpha: Array | None
    samples: Array
    rejected: float
    frames: tuple[int, ...]


def accumulate(
    target: Stored,
    others: Sequence[Stored],
    movement: Movement | None = None,
    threads: int | None = None,
) -> Accumulated:
    """Return `target` with the samples of `others`.

    `movement` knows what moved by itself in this shot; without it each call finds it
    anew. Nothing is lent across a cut. Without others the result is the target's own
    picture to the bit. `threads`: all processors by default; the result does not depend
    on it. Raises PictureError where the frames hold different passes.
    """
    others = same_take(target, others)
    near, far = _lenders(target, others, movement or Movement())
    usual = light_for_albedo(target) if others and target.has_light else 0.0
    height, width = target.shape
    means = np.empty((height * width, target.picture.shape[1]), np.float32)
    samples = np.empty(height * width, np.float32)

    def work(first: int) -> float:
        block = _Block(target, slice(first, min(first + _ROWS, height)), usual)
        groups = [_gathered(block, group) for group in (near, far) if group]
        for group in groups:
            group.finish()
        means[block.pixels], samples[block.pixels] = _means(target, block, groups)
        return float(sum(group.lent.sum(dtype=np.float64) for group in groups))

    taken = sum(_in_threads(work, range(0, height, _ROWS), threads))
    asked = sum(x.samples for x in others) * height * width
    rejected = 1.0 - taken / asked if asked else 0.0
    frames = tuple(sorted({target.number, *(x.number for x in others)}))
    return _unpacked(target, means, samples, rejected, frames)


def _lenders(
    target: Stored, others: Sequence[Stored], movement: Movement
) -> tuple[list[_Same | _Lender], list[_Same | _Lender]]:
    """Return what asks each neighbour: the nearest ones, and those farther away."""
    rest = [x for x in others if not target.shows_same(x)]
    detours = dict(zip(map(id, rest), movement.detours(target, rest), strict=True))
    around = surroundings(target) if rest else None
    near = _nearest(target, others)
    groups: tuple[list[_Same | _Lender], list[_Same | _Lender]] = ([], [])
    for other in others:
        lender: _Same | _Lender = _Same(other)
        if id(other) in detours:
            lender = _Lender(pair(target, other, detours[id(other)], around))
        groups[other.number not in near].append(lender)
    return groups


def _nearest(target: Stored, others: Sequence[Stored]) -> set[int]:
    """Return the numbers of the frames just before and after, and the frame's own."""
    before = [x.number for x in others if x.number < target.number]
    after = [x.number for x in others if x.number > target.number]
    return {target.number, *sorted(before)[-1:], *sorted(after)[:1]}


class _Block:
    """Some rows of the target, with a margin that the judge looks at.

    `usual` is as in `Judge`. `void` (n,) says
    where a frame with alpha has none, in a pixel or beside it: there is no noise to
    take away, and a rim that several frames draw is wider than that of one.
    """

    def __init__(self, target: Stored, rows: slice, usual: float) -> None:
        height, width = target.shape
        first, last = max(rows.start - MARGIN, 0), min(rows.stop + MARGIN, height)
        self.rows = slice(first, last)
        self.pixels = slice(rows.start * width, rows.stop * width)
        self.wide = grid(target.shape, first, last)
        start = self.pixels.start - first * width
        self.inner = slice(start, start + self.pixels.stop - self.pixels.start)
        self.own = _floats(target.picture[self.wide.pixels])
        self.void = self._void()
        self.known = np.ones(len(self.own), bool)
        if target.spoilt is not None:
            self.known = ~target.spoilt[self.wide.pixels]
        self.judge = _judge(target, self, usual) if target.has_light else None

    def _void(self) -> Mask | None:
        if not self.own.shape[1] % 3:
            return None
        least = extreme(self.shaped(self.own[:, -1]), np.fmin)
        return np.asarray(least.ravel() == 0.0)

    def shaped(self, x: NDArray[Any]) -> NDArray[Any]:
        """The rows (n, ...) as (H, W, ...)."""
        return x.reshape(self.rows.stop - self.rows.start, -1, *x.shape[1:])


def _judge(target: Stored, block: _Block, usual: float) -> Judge:
    noise, pixels = target.noise, block.wide.pixels
    assert noise is not None
    parts = (noise.brightness, noise.difference, noise.guides)
    brightness, difference, guides = (block.shaped(_floats(x[pixels])) for x in parts)
    return Judge(
        block.shaped(block.own),
        brightness,
        difference,
        np.square(guides),
        block.shaped(block.known),
        target.samples,
        usual,
    )


class _Sums:
    """What some neighbours lend to the wide rows of a block.

    `values` (n, C) and `brightness` (n,) are sums by weight, `weights` (n,) the
    weights, `lent` (n,) the samples.
    """

    def __init__(self, block: _Block) -> None:
        self.block = block
        self.values = np.zeros_like(block.own)
        self.weights, self.lent, self.brightness = np.zeros(
            (3, len(block.own)), np.float32
        )

    def add(
        self, values: Array, weight: Array, lent: Array, noise: tuple[Array, ...]
    ) -> None:
        """Add a neighbour's; of `noise` see `_noise`."""
        if self.block.judge is not None:
            self.brightness += noise[0] * weight
            self.block.judge.see(*map(self.block.shaped, (values, *noise, weight)))
        values *= weight[:, None]
        self.values += values
        self.weights += weight
        self.lent += lent

    def finish(self) -> None:
        """Let all count as far as they are right, on the block's own rows alone."""
        block = self.block
        weights = np.maximum(self.weights, _TINY)
        means = block.shaped(self.values / weights[:, None])
        seen = block.shaped(self.weights > 0.0)
        if block.judge is not None:
            root = block.shaped(self.brightness / weights)
            trust = block.judge.trust(means[..., 3:], root, seen)
        else:
            own, known = block.shaped(block.own), block.shaped(block.known)
            trust = GuideJudge(own, known).trust(means, seen)
        self._scale(trust.ravel())
        if block.void is not None:
            self._scale((~block.void).astype(np.float32))
        inner = block.inner
        self.values, self.weights = self.values[inner], self.weights[inner]
        self.lent = self.lent[inner]

    def _scale(self, trust: Array) -> None:
        self.values *= trust[:, None]
        self.weights *= trust
        self.lent *= trust


def _gathered(block: _Block, lenders: Sequence[_Same | _Lender]) -> _Sums:
    """Return what a group of neighbours would lend to a block."""
    sums = _Sums(block)
    for lender in lenders:
        lender.add(block, sums)
    return sums


def _noise(
    other: Stored, pixels: slice | NDArray[np.integer], block: _Block
) -> tuple[Array, ...]:
    """Return brightness and difference (n,) of flat pixels; nothing unasked."""
    if block.judge is None or other.noise is None:
        return ()
    noise = other.noise
    return tuple(_floats(x[pixels]) for x in (noise.brightness, noise.difference))


class _Same:
    """A neighbour that shows the same in every pixel: there is nothing to look for."""

    def __init__(self, other: Stored) -> None:
        self._other = other

    def add(self, block: _Block, sums: _Sums) -> None:
        """As `_Lender.add`."""
        other, pixels = self._other, block.wide.pixels
        weight = _samples(other, pixels, len(block.own))
        if other.spoilt is not None:
            weight[other.spoilt[pixels]] = 0.0
        # a copy: NumPy's own float32 pictures are not to be changed
        picked = _floats(other.picture[pixels]).copy()
        sums.add(picked, weight, weight, _noise(other, pixels, block))


class _Lender:
    """A neighbour whose pixels are looked for, and asked whether they agree."""

    def __init__(self, pair: Pair) -> None:
        target, other = pair.here, pair.there
        if other.picture.shape[1] != target.picture.shape[1]:
            raise PictureError(
                f"frame {other.number} and frame {target.number} hold different passes:"
                " give radiance and alpha for all frames of a shot or for none"
            )
        self._pair = pair
        self._tiles = survey(pair)
        self._turn = _turn(target.camera, other.camera)
        self._fall = np.float32(-0.5 * target.samples ** (2 / 3) / _SOFTNESS**2)

    def add(self, block: _Block, sums: _Sums) -> None:
        """Add the samples it lends to the pixels of a block."""
        other = self._pair.there
        if not self._tiles.any():
            return
        found = places(self._pair, block.wide)
        if other.spoilt is not None:
            found.seen[...] &= ~other.spoilt.take(found.pixel)
        picked = _floats(other.picture.take(found.pixel, axis=0))
        if self._turn is not None:
            normal = slice(6, 9) if other.has_light else slice(3, 6)
            picked[:, normal] = picked[:, normal] @ self._turn.T
        weight = found.seen.astype(np.float32)
        weight *= spread(self._tiles, self._pair.here.shape, block.rows).ravel()
        weight *= _samples(other, found.pixel, len(weight))
        lent = weight.copy()
        weight *= np.exp(found.apart * self._fall)
        sums.add(picked, weight, lent, _noise(other, found.pixel, block))


def _samples(
    frame: Stored, pixels: slice | NDArray[np.integer], count: int
) -> NDArray[np.float32]:
    """Return how many samples flat pixels (n,) of a frame have."""
    if frame.counts is None:
        return np.full(count, frame.samples, np.float32)
    return _floats(frame.counts[pixels]).copy()


def _means(
    target: Stored, block: _Block, groups: Sequence[_Sums]
) -> tuple[Array, Array]:
    """Return the means of the target's own samples and those lent, and their number."""
    own = block.own[block.inner]
    samples = _samples(target, block.pixels, len(own))
    if target.spoilt is not None:
        samples[target.spoilt[block.pixels]] = 0.0
    if not groups:
        return np.where(samples[:, None] > 0.0, own, np.float32(np.nan)), samples
    sums = np.sum([group.values for group in groups], axis=0)
    weights = np.sum([group.weights for group in groups], axis=0)
    total = samples + weights
    sums -= own * weights[:, None]
    with np.errstate(invalid="ignore"):  # NaN where nobody has samples
        sums /= total[:, None]
    # in this form nothing is rounded where nothing is lent
    return own + sums, total


def _unpacked(
    target: Stored,
    means: Array,
    samples: Array,
    rejected: float,
    frames: tuple[int, ...],
) -> Accumulated:
    parts = [
        np.ascontiguousarray(x).reshape(*target.shape, -1)
        for x in np.split(means, range(3, means.shape[1], 3), axis=1)
    ]
    alpha = parts.pop()[..., 0] if means.shape[1] % 3 else None
    *radiance, albedo, normal = parts
    return Accumulated(
        radiance[0] if radiance else None,
        albedo,
        normal,
        alpha,
        samples.reshape(target.shape),
        rejected,
        frames,
    )


def _turn(here: Camera, there: Camera) -> Array | None:
    """Return (3, 3) that takes normals of `there` to `here`; None if they agree."""
    turn = here.view[:3, :3] @ np.linalg.inv(there.view[:3, :3])
    turn = _axes(here) @ turn @ _axes(there).T
    return None if np.allclose(turn, np.eye(3), atol=1e-7) else turn.astype(np.float32)


def _axes(camera: Camera) -> Matrix:
    """Return (3, 3): from the axes of view matrices to those of Cycles' normals.

    There Z points away from the viewer; in panoramas X does, and Z upwards.
    """
    if camera.sphere is None:
        return np.diag([1.0, 1.0, -1.0])
    return np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def _floats(x: NDArray[Any]) -> Array:
    """Return `x` in float32; half floats from a table, in half of NumPy's time."""
    if x.dtype == np.float16:
        return np.asarray(_HALVES.take(np.ascontiguousarray(x).view(np.uint16)))
    return x.astype(np.float32, copy=False)


def _in_threads(
    work: Callable[[int], float], items: Sequence[int], threads: int | None
) -> list[float]:
    """Do every item; NumPy lets threads run at once in all that takes long here."""
    count = min(threads or os.cpu_count() or 1, len(items))
    with ThreadPoolExecutor(max(count, 1)) as pool:
        return list(pool.map(work, items))
