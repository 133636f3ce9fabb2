"""Drawing crops from training windows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import PictureError
from xrds_core.superres.front_end import clean_albedo, clean_radiance

from .augmentation import (
    over_denoised,
    permute_colours,
    random_rotation,
    shade,
    tint,
    transpose_and_flip,
)
from .crop import Batch, Crop
from .windows import LOW_RENDERS, WHOLE, Box, Window, low_name

# Of radiance at the automatic exposure: darker than this, noise is not transplanted.
NOISE_FLOOR = 0.01


@dataclass(frozen=True)
class Variation:
    """How crops are drawn and varied; the defaults leave a window as it is."""

    noisy: float = 0.0
    """Share of crops whose low-resolution radiance is not denoised."""
    denoised_only: float = 0.0
    """Share of the other crops that come without their radiance before denoising."""
    exposure_stops: float = 0.0
    """Standard deviation of the exposure around the automatic one, in stops."""
    tint_stops: float = 0.0
    """Standard deviation of a tint of radiance and albedo, in stops per channel."""
    rotated_normals: float = 0.0
    """Share of crops whose normals are turned at random, as if of another space."""
    black: float = 0.0
    """Share of crops without any light under their guides."""
    shaded: float = 0.0
    """Share of crops lit anew: their albedo under smooth light, without path tracing.

    There demodulation is exact, which teaches the network to trust it where radiance
    over albedo is smooth.
    """
    over_denoised: float = 0.0
    """Share of the crops lit anew whose low-resolution texture is smoothed away."""
    symmetries: bool = False
    """Flips, transposition and permutations of the colour channels."""
    padded: float = 0.0
    """Share of steps whose crops the network must pad, as it pads most pictures.

    They are smaller by up to a quarter: their sides are no multiples of its windows.
    """


def draw(
    window: Window,
    scale: int,
    variation: Variation,
    random: np.random.Generator,
    size: int | None = None,
) -> Batch:
    """Cut one varied crop of `size` output pixels (None: the whole window)."""
    crop = cut(window, scale, variation, random, size)
    if random.random() < variation.black:
        crop = crop.with_light(np.zeros_like)
    if variation.symmetries:
        crop = permute_colours(crop, random)
        crop = transpose_and_flip(crop, random)
    if variation.tint_stops:
        crop = tint(crop, variation.tint_stops, random)
    if random.random() < variation.rotated_normals:
        crop = replace(crop, normal=crop.normal @ random_rotation(random))
    return crop.to_batch()


def cut(
    window: Window,
    scale: int,
    variation: Variation,
    random: np.random.Generator,
    size: int | None,
) -> Crop:
    """One crop of one low-resolution render and one quality of guides."""
    index = int(random.integers(LOW_RENDERS))
    name, noisy_name = (low_name(scale, index, kind) for kind in (False, True))
    if random.random() < variation.noisy:
        name = noisy_name
    elif random.random() < variation.denoised_only:
        noisy_name = name
    stops = random.normal(0, variation.exposure_stops)
    exposure = window.exposures[name] * float(2**stops)
    if size is not None and size > min(window.arrays["reference"].shape[:2]):
        raise PictureError(f"{window.path} is smaller than a crop of {size} pixels")
    low_box, box = boxes(window.arrays[name].shape, scale, size, random)
    low, noisy = (
        clean_radiance(window.array(n, low_box))[0] for n in (name, noisy_name)
    )
    reference, _ = clean_radiance(window.array("reference", box))
    albedo, normal = mix_guides(window, box, random)
    if random.random() < variation.shaded:
        denoised = low
        low, reference = shade(mean_albedo(window, box), scale, exposure, random)
        noisy = with_noise_of(noisy, denoised, low, exposure)
        if random.random() < variation.over_denoised:
            low = over_denoised(low, random)
    return Crop(low, noisy, reference, albedo, normal, exposure)


def boxes(
    shape: tuple[int, ...], scale: int, size: int | None, random: np.random.Generator
) -> tuple[Box, Box]:
    """A random square, in low-resolution and in output pixels; None for the whole."""
    if size is None:
        return WHOLE, WHOLE
    side = size // scale
    y, x = (int(random.integers(n - side + 1)) for n in shape[:2])
    low = np.s_[y : y + side, x : x + side]
    return low, np.s_[y * scale : (y + side) * scale, x * scale : (x + side) * scale]


def mix_guides(
    window: Window, box: Box, random: np.random.Generator
) -> tuple[Array, Array]:
    """Albedo and normal of one of the two guide renders, or their mean by samples."""
    a, b = window.meta["guide_spp"]
    share = ((a / (a + b)), 1.0, 0.0)[random.integers(3)]
    parts = {"guides_a": np.float32(share), "guides_b": np.float32(1 - share)}
    mixed = sum(window.array(name, box) * part for name, part in parts.items() if part)
    albedo, normal = np.split(mixed, 2, axis=-1)
    return clean_albedo(albedo)[0], normal


def mean_albedo(window: Window, box: Box) -> Array:
    """Of both guide renders: the least noisy there is."""
    both = [window.array(name, box)[..., :3] for name in ("guides_a", "guides_b")]
    return clean_albedo((both[0] + both[1]) / 2)[0]


def with_noise_of(
    noisy: Array, rendered: Array, reference: Array, exposure: float
) -> Array:
    """`reference` as noisy as `noisy` is beside `rendered`, pixel by pixel."""
    floor = np.float32(NOISE_FLOOR / exposure)
    return reference * ((noisy + floor) / (rendered + floor))
