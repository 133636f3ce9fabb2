"""The means over a frame's own samples and those of its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.specification.filters import Array, extreme
from tests.support.specification.places import places, rims
from tests.support.specification.registration import changes, moments, registered
from tests.support.specification.similarity import GuideSimilarity, LightSimilarity
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.noise import brightness as root_of_luminance
from xrds_core.accumulation.virtual_images import Images
from xrds_core.accumulation.weighted_sums import Aligned, Means, Reprojected

Neighbour = Aligned | Reprojected
Judge = LightSimilarity | GuideSimilarity

AS_DISTANCE = 0.25  # of offsets that are taken out
TRUSTED_AT_RIMS = 8.0  # samples of half an offset at edges
TILE = 64
LARGEST_HALF = 65504.0
TINY = np.float32(1e-9)


def floats(x: Array) -> Array:
    return x.astype(np.float32)


@dataclass(frozen=True)
class Work:
    """As `temporal.sums.Work`, which it takes the place of."""

    target: Stored
    images: Images | None
    usual: float
    lit: tuple[str, ...]
    threads: int | None

    def guess(self, neighbours: Sequence[Neighbour]) -> Array:
        means = self.means([neighbours])
        light = root_of_luminance(means.passes[0]) if self.target.has_light else 0
        planes = [each.reshape(-1, each.shape[-1]) for each in means.passes]
        planes += [each.reshape(-1, 3) for each in means.parts]
        light = np.broadcast_to(light, self.target.shape).reshape(-1, 1)
        guess = np.clip(np.hstack([*planes, light]), -LARGEST_HALF, LARGEST_HALF)
        return guess.T.reshape(-1, *self.target.shape).astype(np.float16)

    def means(self, groups: Sequence[Any], guess: Array | None = None) -> Means:
        frame = self.target
        own = np.hstack(
            [floats(frame.picture), *(self.part(frame, x) for x in self.lit)]
        )
        known = np.ones(len(own), bool) if frame.invalid is None else ~frame.invalid
        judge = self.judge(known)
        sums = [self.sums(group, judge, guess) for group in groups]
        clear = np.ones(len(own), bool)
        if frame.picture.shape[1] % 3:
            alpha = floats(frame.picture[:, -1]).reshape(frame.shape)
            clear = extreme(alpha, np.fmin, 1).ravel() != 0.0
        total = np.where(known, counts(frame, slice(None)), np.float32(0))
        mine, added, reused = total, np.zeros_like(own), 0.0
        for values, bright, weights, shares in sums:
            mean = values / np.maximum(weights, TINY)[:, None]
            passes = mean[:, : frame.picture.shape[1]].reshape(*frame.shape, -1)
            passes = passes[..., 3:] if frame.has_light else passes
            root = (bright / np.maximum(weights, TINY)).reshape(frame.shape)
            like = judge.weights(passes, root, (weights > 0).reshape(frame.shape))
            like = floats(like.ravel() * clear)
            added += values * like[:, None]
            total = total + weights * like
            reused += float((shares * like).sum(dtype=np.float64))
        with np.errstate(invalid="ignore"):  # NaN where no frame has samples
            found = own + (added - own * (total - mine)[:, None]) / total[:, None]
        planes = [found[:, k : k + 3] for k in range(0, found.shape[1], 3)]
        channels = frame.picture.shape[1]
        if channels % 3:
            passes = [found[:, k : min(k + 3, channels)] for k in range(0, channels, 3)]
            planes = passes + [
                found[:, k : k + 3] for k in range(channels, found.shape[1], 3)
            ]
        planes = [np.ascontiguousarray(x).reshape(*frame.shape, -1) for x in planes]
        count = -(-channels // 3)
        return Means(planes[:count], planes[count:], total.reshape(frame.shape), reused)

    def judge(self, known: Array) -> Judge:
        frame, shape = self.target, self.target.shape
        picture = floats(frame.picture).reshape(*shape, -1)
        known = known.reshape(shape)
        if not frame.has_light:
            return GuideSimilarity(picture, known)
        noise = frame.noise
        planes = noise.brightness, noise.difference, np.square(floats(noise.guides))
        noise = [floats(x).reshape(shape) for x in planes]
        return LightSimilarity(frame, picture, noise, known, np.float32(self.usual))

    def sums(
        self, group: Sequence[Neighbour], judge: Judge, guess: Array | None
    ) -> tuple[Array, ...]:
        """Weighted values, brightness, weights, and samples taken of a group."""
        frame = self.target
        channels = frame.picture.shape[1] + 3 * len(self.lit)
        count = len(frame.picture)
        values, (bright, weights, shares) = (
            np.zeros((count, channels)),
            np.zeros((3, count)),
        )
        summed = np.zeros((5, count), np.float32)
        for found in group:
            if found.pair and not found.is_reused:
                continue
            taken, share, weight, offsets = self.taken(found, guess is not None)
            picture, light = self.picture(found, taken)
            summed += moments(*offsets, weight)
            values += picture * weight[:, None]
            weights, shares = weights + weight, shares + share
            if light:
                bright = bright + light[0] * weight
                shaped = picture[:, : frame.picture.shape[1]].reshape(*frame.shape, -1)
                judge.add(shaped, *(x.reshape(frame.shape) for x in (*light, weight)))
        if guess is not None:
            values, bright = self.registered(values, bright, weights, guess, summed)
        return floats(values), floats(bright), floats(weights), floats(shares)

    def registered(
        self, values: Array, bright: Array, weights: Array, guess: Array, summed: Array
    ) -> tuple[Array, Array]:
        """Values (n, C) and brightness less what offsets change.

        Parts of the light take out the shares that count of the whole.
        """
        together, own = np.vstack([values.T, bright]), self.target.picture.shape[1]
        found, shares = registered(together, weights, guess, summed)
        if self.target.has_light and self.lit:
            of_parts = np.tile(shares[:3], (len(self.lit), 1))
            with np.errstate(invalid="ignore"):
                change = of_parts * changes(guess[own:-1], summed)
            change[~np.isfinite(change)] = 0.0
            found[own:-1] = together[own:-1] - change
        return found[:-1].T, found[-1]

    def taken(self, found: Neighbour, registers: bool) -> tuple[Array, ...]:
        """Pixels taken of a neighbour, samples of each, weights, and offsets."""
        other, count = found.other, len(self.target.picture)
        nothing = np.zeros((2, count), np.float32)
        if not found.pair:
            pixel, seen, apart, share = np.arange(count), np.ones(count, bool), 0, 1
            offsets, fall = nothing, 0
        else:
            at = places(found.pair, self.images, found.fall)
            pixel, seen, apart, fall = at.pixel, at.seen, at.apart, found.fall
            share = self.tiles(found)
            edge = rims(self.target) | rims(other)[pixel]
            samples = np.float32(self.target.samples)
            trust = np.where(edge, samples / (samples + TRUSTED_AT_RIMS), np.float32(1))
            offsets = np.stack([at.x, at.y]) * (seen * trust) if registers else nothing
        if other.invalid is not None:
            seen = seen & ~other.invalid[pixel]
        share = floats(share * seen) * counts(other, pixel)
        apart = apart - (1 - AS_DISTANCE) * np.square(offsets).sum(0)
        return pixel, share, floats(share * np.exp(apart * np.float32(fall))), offsets

    def tiles(self, found: Reprojected) -> Array:
        """The weights of a neighbour's pixels by coarse rejection."""
        share = tile_shares(found.tiles, self.target.shape).ravel()
        if self.images is not None:
            share[self.images.positions(found.pair)[0]] = found.tiles.max()
        return floats(share)

    def picture(self, found: Neighbour, pixel: Array) -> tuple[Array, Any]:
        """Values (n, C) of pixels taken, and brightness and difference, if any."""
        other = found.other
        picture = floats(other.picture[pixel])
        if found.pair and found.pair.turn is not None:
            picture[:, other.normals] = picture[:, other.normals] @ found.pair.turn.T
        parts = [self.part(other, name)[pixel] for name in self.lit]
        light = ()
        if other.noise is not None and self.target.has_light:
            light = (
                floats(other.noise.brightness[pixel]),
                floats(other.noise.difference[pixel]),
            )
        return np.hstack([picture, *parts]), light

    def part(self, frame: Stored, name: str) -> Array:
        part = frame.parts[name]
        dark = np.zeros((len(frame.picture), 3), np.float32)
        return dark if part is None else floats(part)


def tile_shares(tiles: Array, shape: tuple[int, int]) -> Array:
    """The weights (H, W) of tiles, linear between their centres."""
    places = (
        np.clip((np.arange(n) + 0.5) / TILE - 0.5, 0, k - 1)
        for n, k in zip(shape, tiles.shape, strict=True)
    )
    down, across = (
        np.maximum(1 - np.abs(place - np.arange(k)[:, None]), 0)
        for place, k in zip(places, tiles.shape, strict=True)
    )
    return floats(down.T @ tiles @ across)


def counts(frame: Stored, pixels: Array | slice) -> Array:
    if frame.counts is None:
        return np.full(len(frame.picture), frame.samples, np.float32)[pixels]
    return floats(frame.counts[pixels])
