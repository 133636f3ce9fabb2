"""The noisy samples of other frames on the pixels of one: gathered, never interpolated.

Each pixel takes the other frame's nearest pixel as it is. Interpolation would correlate
the noise of neighbouring pixels, and denoisers take correlated noise for texture. The
mean is weighted by sample counts and by how near the pixel taken lies to the true
place, which keeps fine texture sharp.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import PictureError
from .motion import grid, pair, places

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from .frame import Array, Camera, Stored
    from .motion import Detour, Grid, Pair

# Standard deviation, in pixels, of the weight by distance: a wider one loses texture at
# many samples per pixel, a narrower one loses samples.
SHARPNESS = 0.4
_ROWS = 48  # at a time: their arrays stay in a processor's cache
_NORMAL = slice(6, 9)  # of the packed channels: radiance, albedo, normal, alpha


@dataclass(frozen=True)
class Accumulated:
    """A frame with the samples of its neighbours; float32, (H, W, 3) or (H, W).

    ``radiance``, ``albedo``, ``normal`` (in this frame's axes) and ``alpha`` (or None)
    are means over ``samples`` (H, W) samples per pixel, NaN where no frame has any.
    ``others`` is the mean radiance of the neighbours alone, over ``lent`` (H, W)
    samples, 0 where none lent. ``rejected`` is the share of the neighbours' pixels that
    could not be used.
    """

    radiance: Array
    albedo: Array
    normal: Array
    alpha: Array | None
    samples: Array
    others: Array
    lent: Array
    rejected: float


def accumulate(
    target: Stored,
    others: Sequence[Stored],
    detours: Mapping[int, Detour] | None = None,
    threads: int | None = None,
) -> Accumulated:
    """Return ``target`` with the samples of ``others``.

    ``detours`` tells, by the position in ``others``, the places of things that moved by
    themselves (see `moving`). Without others the result is the target's own picture to
    the bit. Raises PictureError where the frames hold different passes.
    """
    detours = detours or {}
    lenders = [_Lender(target, x, detours.get(i)) for i, x in enumerate(others)]
    height, width = target.shape
    means = np.empty((height * width, target.picture.shape[1]), np.float32)
    radiance = np.empty((height * width, 3), np.float32)
    lent = np.empty(height * width, np.float32)

    def work(first: int) -> int:
        block = grid(target.shape, first, min(first + _ROWS, height))
        sums = np.zeros((len(block.x), means.shape[1]), np.float32)
        weights = np.zeros(len(block.x), np.float32)
        seen = sum(lender.add(block, sums, weights) for lender in lenders)
        sums /= np.maximum(weights, np.float32(1e-30))[:, None]
        radiance[block.pixels], lent[block.pixels] = sums[:, :3], weights
        means[block.pixels] = _joined(target, block.pixels, sums, weights)
        return seen

    seen = sum(_in_threads(work, range(0, height, _ROWS), threads))
    rejected = 1.0 - seen / (len(others) * lent.size) if others else 0.0
    return _unpacked(target, means, radiance, lent, rejected)


class _Lender:
    """One neighbour of the target."""

    def __init__(self, target: Stored, other: Stored, detour: Detour | None) -> None:
        if other.picture.shape[1] != target.picture.shape[1]:
            raise PictureError(
                f"frame {other.number} and frame {target.number} hold different passes:"
                " give alpha for all frames of a shot or for none"
            )
        self._pair = pair(target, other, detour)
        self._turn = _turn(target.camera, other.camera)

    def add(self, block: Grid, sums: Array, weights: Array) -> int:
        """Add the samples it lends to the pixels of a block; return to how many."""
        found, other = places(self._pair, block), self._pair.there
        if other.spoilt is not None:
            found.seen[...] &= ~other.spoilt.take(found.pixel)
        weight = np.exp(found.apart * np.float32(-0.5 / SHARPNESS**2))
        weight *= found.seen
        weight *= np.float32(other.samples)
        picked = other.picture.take(found.pixel, axis=0).astype(np.float32, copy=False)
        if self._turn is not None:
            picked[:, _NORMAL] = picked[:, _NORMAL] @ self._turn.T
        picked *= weight[:, None]
        sums += picked
        weights += weight
        return int(np.count_nonzero(found.seen))


def _joined(target: Stored, pixels: slice, others: Array, lent: Array) -> Array:
    """Return the means of the target's own samples and those lent."""
    own = target.picture[pixels].astype(np.float32, copy=False)
    share = lent / (lent + np.float32(target.samples))
    if target.spoilt is not None:
        spoilt = target.spoilt[pixels]
        share[spoilt] = np.where(lent[spoilt] > 0.0, np.float32(1.0), np.float32(np.nan))
    # in this form nothing is rounded where nothing is lent
    return np.asarray(own + (others - own) * share[:, None])


def _unpacked(
    target: Stored, means: Array, others: Array, lent: Array, rejected: float
) -> Accumulated:
    radiance, albedo, normal, *alpha = (
        np.ascontiguousarray(x).reshape(*target.shape, -1)
        for x in np.split(means, range(3, means.shape[1], 3), axis=1)
    )
    lent = lent.reshape(target.shape)
    own = np.full(target.shape, target.samples, np.float32)
    if target.spoilt is not None:
        own[target.spoilt.reshape(target.shape)] = 0.0
    return Accumulated(
        radiance,
        albedo,
        normal,
        alpha[0][..., 0] if alpha else None,
        own + lent,
        others.reshape(*target.shape, 3),
        lent,
        rejected,
    )


def _turn(here: Camera, there: Camera) -> Array | None:
    """Return (3, 3) that takes normals of ``there`` to ``here``; None if they agree.

    Z points away from the viewer in both, against what view matrices say.
    """
    away = np.diag([1.0, 1.0, -1.0])
    turn = away @ here.view[:3, :3] @ np.linalg.inv(there.view[:3, :3]) @ away
    return None if np.allclose(turn, np.eye(3), atol=1e-7) else turn.astype(np.float32)


def _in_threads(
    work: Callable[[int], int], items: Sequence[int], threads: int | None
) -> list[int]:
    """Do every item; NumPy lets threads run at once in all that takes long here."""
    count = min(threads or os.cpu_count() or 1, len(items))
    with ThreadPoolExecutor(max(count, 1)) as pool:
        return list(pool.map(work, items))
