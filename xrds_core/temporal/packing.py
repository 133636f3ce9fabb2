"""Packs passes in half floats, as frames are stored, and tells the noise of a frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..native import structures
from ..native.library import Arrays, library
from ..native.threads import bands, in_threads
from .half_floats import LARGEST_HALF
from .noise import Noise, guide_factor, light_factor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..arrays import Array
    from .halves import Halves

    Passes = tuple[Array | None, Array, Array, Array | None]
    Mask = NDArray[np.bool_]


_SEED = 7


def pack(
    radiance: Array | None, albedo: Array, normal: Array, alpha: Array | None
) -> tuple[NDArray[np.float16], Mask]:
    """Return `Stored.picture` of passes as in `Frame`, and its invalid pixels (H W)."""
    packing = _Packing((radiance, albedo, normal, alpha))
    packing.run()
    return packing.picture, packing.invalid


def pack_with_noise(
    passes: Passes, samples: float, halves: Halves | None
) -> tuple[NDArray[np.float16], Mask, Noise]:
    """Return the same of a frame with radiance, and its noise, 0 at invalid pixels.

    The noise is that of its `halves`, where there are any.
    """
    packing = _Packing(passes)
    noise = packing.run_with_noise(samples, halves)
    return packing.picture, packing.invalid, noise


def pack_parts(parts: Mapping[str, Array]) -> dict[str, NDArray[np.float16] | None]:
    """Return `Stored.parts`; a part is 0 where it is not finite, the picture stays."""
    return {name: _packed_part(part) for name, part in parts.items()}


def _packed_part(part: Array) -> NDArray[np.float16] | None:
    packed, has_any = _to_halves(part, keeps_infinities=False)
    return packed if has_any else None


def pack_vectors(vector: Array) -> NDArray[np.float16]:
    """Return (H W, 4); infinite beyond half's range, where vectors are useless."""
    return _to_halves(vector, keeps_infinities=True)[0]


def pack_counts(counts: Array) -> NDArray[np.float16]:
    """Flat, in half floats; what is no count becomes 0."""
    counts = np.nan_to_num(counts.ravel(), posinf=0.0, neginf=0.0)
    return np.clip(counts, 0.0, LARGEST_HALF).astype(np.float16)


class _Packing:
    """One frame that the library packs."""

    def __init__(self, passes: Passes) -> None:
        radiance, albedo, normal, alpha = passes
        self._arrays = Arrays()
        self._shape = height, width = normal.shape[:2]
        given = [x for x in (radiance, albedo, normal) if x is not None]
        channels = 3 * len(given) + (alpha is not None)
        if alpha is not None:
            given.append(alpha[..., None])
        self.picture = np.empty((height * width, channels), np.float16)
        self.invalid = np.empty(height * width, np.bool_)
        self._packing = structures.Packing(
            count=len(given),
            width=width,
            height=height,
            has_light=radiance is not None,
            picture=self.picture.ctypes.data,
            invalid=self.invalid.ctypes.data,
        )
        self._packing.passes[: len(given)] = [_pass(self._arrays, x) for x in given]

    def run_with_noise(self, samples: float, halves: Halves | None) -> Noise:
        """Pack, and return the noise: of halves, or of the pixels around each one."""
        count = len(self.invalid)
        noise = Noise(np.empty((count, 2), np.float16), np.empty(count, np.float16))
        self._packing.guide_factor = guide_factor(samples)
        self._packing.noise = noise.light.ctypes.data
        self._packing.guide_noise = noise.guides.ctypes.data
        if halves is not None:
            self._packing.halves[:] = [_pass(self._arrays, x) for x in halves.radiance]
            share = halves.share()
            if share.ndim:
                self._packing.shares = self._arrays.at(share, np.float32, count)
            else:
                self._packing.share = share
        else:
            # the sign of a difference is random, as it would be between halves
            signs = np.random.default_rng(_SEED).integers(0, 2, count, np.uint8)
            self._packing.signs = self._arrays.at(signs, np.uint8, count)
            self._packing.light_factor = light_factor(samples)
        self.run()
        return noise

    def run(self) -> None:
        """Pack."""

        def work(rows: tuple[int, int]) -> None:
            size = library().packing_bytes(self._packing, rows[1] - rows[0])
            scratch = np.empty(size, np.uint8)
            library().pack(self._packing, *rows, scratch.ctypes.data)

        in_threads(work, bands(self._shape[0]))


def _to_halves(
    picture: Array, keeps_infinities: bool
) -> tuple[NDArray[np.float16], bool]:
    """Return (H W, C), and whether any number in it is not 0."""
    height, width, channels = picture.shape
    packed = np.empty((height * width, channels), np.float16)
    arrays = Arrays()
    given = _pass(arrays, picture)

    def work(rows: tuple[int, int]) -> int:
        return int(
            library().to_halves(
                given, width, *rows, keeps_infinities, packed.ctypes.data
            )
        )

    return packed, any(in_threads(work, bands(height)))


def _pass(arrays: Arrays, picture: Array) -> structures.Pass:
    """A picture (H, W, C) as the library takes it, whatever its strides."""
    first, strides = arrays.strided(picture)
    return structures.Pass(first, *strides, picture.shape[2])
