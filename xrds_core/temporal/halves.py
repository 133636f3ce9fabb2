"""Two halves of a frame's samples, and what they say of its noise.

The mean of a frame lies off the truth by noise that the frame alone cannot tell from
texture. Two halves of its samples can: what they share is the picture, what they differ
in is noise, pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .agreement import brightness

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

    from ..arrays import Array

# Albedo beyond this is a lamp; it must not outvote the pixels around it.
_BRIGHTEST = 4.0
# Normals turn where nothing else changes, so they count less than albedo.
_NORMAL_SHARE = 0.1
# Parts of one sequence fill each other's gaps, so they differ more than independent
# halves would: their correlation is about -1/20 for each doubling of the samples.
_CORRELATION = -1 / 20
_TINY = np.float32(1e-9)


@dataclass(frozen=True)
class Halves:
    """What each half of a frame's samples shows; float32, the two halves first.

    `radiance`, `albedo`, `normal` (2, H, W, 3) and `alpha` (2, H, W), or None, are as
    in `Frame`, which holds the means of both. The halves are two parts of one sample
    sequence, or of two seeds. Each has its share of the samples, or by `counts`
    (2, H, W) as many in each pixel.
    """

    radiance: Array
    albedo: Array
    normal: Array
    alpha: Array | None = None
    shares: tuple[float, float] = (0.5, 0.5)
    counts: Array | None = None

    def share(self) -> Array:
        """Return how much of the samples the first half has: (H, W), or one number."""
        if self.counts is None:
            return np.asarray(self.shares[0], np.float32)
        one, two = self.counts
        return np.where(one > 0.0, one / np.maximum(one + two, _TINY), 0.0)

    def mean(self, name: str) -> Array | None:
        """Return the mean of both halves of a pass by its name."""
        halves = getattr(self, name)
        if halves is None:
            return None
        share = self.share()
        if halves.ndim == 4:
            share = share[..., None]
        return np.asarray(halves[0] * share + halves[1] * (np.float32(1.0) - share))


@dataclass(frozen=True, eq=False)
class Noise:
    """What the halves of a frame say of its noise, flat, (H W).

    `brightness` is the mean of the roots of both halves' luminance, `difference` half
    of what these roots differ by. `guides` is the standard deviation of the
    frame's guides.
    """

    brightness: NDArray[Any]
    difference: NDArray[Any]
    guides: NDArray[Any]

    def without(self, spoilt: NDArray[np.bool_]) -> Noise:
        """Return the same with 0 at `spoilt` pixels (H W), which tell nothing."""
        kept = ~spoilt
        return Noise(self.brightness * kept, self.difference * kept, self.guides * kept)


def guides_of(passes: Array) -> Array:
    """Return albedo, normal and alpha, scaled to be compared.

    `passes` (..., 6 or 7) are these; alpha may be missing.
    """
    scale = np.ones(passes.shape[-1], np.float32)
    scale[3:6] = _NORMAL_SHARE**0.5
    guides = passes * scale
    np.clip(guides, -_BRIGHTEST, _BRIGHTEST, out=guides)
    return guides


def noise_of(halves: Halves, samples: float, dtype: DTypeLike) -> Noise:
    """Return the noise of a frame of `samples` per pixel; finite everywhere."""
    roots = brightness(halves.radiance)
    parts = [halves.albedo, halves.normal]
    if halves.alpha is not None:
        parts.append(halves.alpha[..., None])
    one, two = guides_of(np.concatenate(parts, axis=-1))
    # of the mean: half of what equal halves differ by
    share = halves.share()
    spread = np.sqrt(share * (np.float32(1.0) - share))
    variance = np.square((one - two) * spread[..., None]).sum(axis=-1)
    variance *= np.float32(_independent(samples))
    middle, apart = (roots[0] + roots[1]) / 2, (roots[0] - roots[1]) * spread
    found = (middle, apart, np.sqrt(variance))
    return Noise(*(_packed(x, dtype) for x in found))


def _packed(x: Array, dtype: DTypeLike) -> NDArray[Any]:
    largest = float(np.finfo(np.dtype(dtype).name).max)
    finite = np.nan_to_num(x.ravel(), nan=0.0, posinf=largest, neginf=-largest)
    return np.clip(finite, -largest, largest).astype(dtype)


def _independent(samples: float) -> float:
    """Return the variance of a mean over that of halves taken to be independent."""
    r = max(_CORRELATION * np.log2(max(samples, 1.0)), -0.5)
    return float((1 + r) / (1 - r))
