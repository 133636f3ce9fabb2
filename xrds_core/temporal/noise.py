"""The noise of a frame: of its light by halves of its samples, of its guides by itself.

Guides are smooth along the surfaces they show, in one direction at least. So the least
of a pixel's differences to the lines through it, in four directions, is noise. Without
halves the noise of light is told by the pixels around as well: light divided by albedo
is smooth in most places.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .neighbours import box

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

    from ..arrays import Array
    from .halves import Halves

# Albedo beyond this is a lamp; it must not outvote the pixels around it.
_BRIGHTEST = 4.0
# Normals turn where nothing else changes, so they count less than albedo.
_NORMAL_SHARE = 0.1
# How many times the least difference the noise of guides is, squared: 3.6 if guides
# were noise alone. The more samples, the more of the difference is texture.
_LEAST, _OF_ONE_SAMPLE = 1.2, 2.5
# Without halves: pixels across that are taken to be lit alike, and the root of an
# albedo's luminance, added to it, so that black surfaces tell no light.
_LIT, _DARKEST_ROOT = 5, 0.1
# What halves of few samples say more than the pixels around, variance: halves of one
# sequence complement each other, and noise that light shares with albedo is left out.
_HALVES_SAY_MORE = 1.0
_SEED = 7
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec.709


@dataclass(frozen=True, eq=False)
class Noise:
    """What is known of a frame's noise, flat, (H W).

    `brightness` is the root of the frame's luminance, of two halves the mean of both
    roots; `difference` half of what these roots differ by. `guides` is the standard
    deviation of the frame's guides.
    """

    brightness: NDArray[Any]
    difference: NDArray[Any]
    guides: NDArray[Any]

    def without(self, spoilt: NDArray[np.bool_]) -> Noise:
        """Return the same with 0 at `spoilt` pixels (H W), which tell nothing."""
        kept = ~spoilt
        return Noise(self.brightness * kept, self.difference * kept, self.guides * kept)


def brightness(radiance: Array) -> Array:
    """Return the root of the luminance (..., 3) -> (...).

    The root makes the noise of dark and bright pixels alike, so that a few bright ones
    do not outvote the others.
    """
    return np.asarray(np.sqrt(luminance(radiance)))


def luminance(radiance: Array) -> Array:
    """Return the luminance (..., 3) -> (...), not below 0."""
    return np.maximum(radiance @ _LUMINANCE, np.float32(0.0))


def guides_of(passes: Array) -> Array:
    """Return albedo, normal and alpha, scaled to be compared.

    `passes` (..., 6 or 7) are these; alpha may be missing.
    """
    scale = np.ones(passes.shape[-1], np.float32)
    scale[3:6] = _NORMAL_SHARE**0.5
    guides = passes * scale
    np.clip(guides, -_BRIGHTEST, _BRIGHTEST, out=guides)
    return guides


def noise_of(
    light: Halves | Array, guides: Array, samples: float, dtype: DTypeLike
) -> Noise:
    """Return the noise of a frame of `samples` per pixel; finite everywhere.

    `light` is two halves or, where there are none, radiance (H, W, 3). `guides`
    (H, W, 6 or 7) are albedo, normal and alpha, which may be missing.
    """
    with np.errstate(all="ignore"):  # of infinities
        if isinstance(light, np.ndarray):
            parts = _apart_from_around(light, guides[..., :3], samples)
        else:
            parts = _apart_in_halves(light)
        found = (*parts, noise_of_guides(guides_of(guides), samples))
    return Noise(*(_packed(x, dtype) for x in found))


def noise_of_guides(guides: Array, samples: float) -> Array:
    """Return the standard deviation (H, W) of `guides_of` a frame, all channels'."""
    least = _least_difference(guides)
    least *= np.float32((_LEAST * (1.0 + _OF_ONE_SAMPLE / samples)) ** 0.5)
    return least


def _apart_in_halves(halves: Halves) -> tuple[Array, Array]:
    """Return the mean of both halves' roots of luminance, and their difference."""
    roots = brightness(halves.radiance)
    share = halves.share()
    # of the mean: half of what equal halves differ by
    spread = np.sqrt(share * (np.float32(1.0) - share))
    return (roots[0] + roots[1]) / 2, (roots[0] - roots[1]) * spread


def _apart_from_around(
    radiance: Array, albedo: Array, samples: float
) -> tuple[Array, Array]:
    """Return the root of luminance, and what half of two halves might differ by.

    That is how far a pixel lies from those around it, without the albedo's texture
    where that leaves less. Its sign is by chance, as it would be between halves.
    """
    root, texture = brightness(radiance), brightness(albedo)
    known = np.isfinite(root) & np.isfinite(texture)  # boxes would spread all else
    root, texture = (np.where(known, x, np.float32(0.0)) for x in (root, texture))
    lit = box(root, _LIT) / (box(texture, _LIT) + np.float32(_DARKEST_ROOT))
    even, plain = (x - box(x, 3) for x in (root - lit * texture, root))
    less = box(np.square(plain), _LIT) < box(np.square(even), _LIT)
    # a pixel is a ninth of the mean it is compared with
    more = 9 / 8 * (1.0 + _HALVES_SAY_MORE / samples)
    apart = np.where(less, plain, even) * np.float32(more**0.5)
    signs = np.random.default_rng(_SEED).integers(0, 2, apart.shape, np.int8)
    return root, np.where(signs > 0, apart, -apart)


def _least_difference(x: Array) -> Array:
    """Return (H, W): the least second difference of (H, W, C), over its channels.

    Of four directions, scaled so that each has the variance of the noise.
    """
    height, width = x.shape[:2]
    half = np.pad(x, ((1, 1), (1, 1), (0, 0)), "edge") * np.float32(0.5)
    least = None
    for row, column in ((0, 1), (1, 0), (1, 1), (1, -1)):
        pair = [
            half[1 + i * row : 1 + i * row + height, 1 + i * column :][:, :width]
            for i in (1, -1)
        ]
        apart = x - pair[0]
        apart -= pair[1]
        np.abs(apart, out=apart)
        least = apart if least is None else np.minimum(least, apart, out=least)
    assert least is not None
    squares = np.einsum("ijk,ijk->ij", least, least)
    return np.asarray(np.sqrt(squares * np.float32(2 / 3)))


def _packed(x: Array, dtype: DTypeLike) -> NDArray[Any]:
    largest = float(np.finfo(np.dtype(dtype).name).max)
    finite = np.nan_to_num(x.ravel(), nan=0.0, posinf=largest, neginf=-largest)
    return np.clip(finite, -largest, largest).astype(dtype)
