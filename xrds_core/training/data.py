"""Crops of training windows, and how they are varied."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ..front_end import clean_albedo, clean_radiance, transfer
from .windows import LOW_RENDERS, WHOLE, Array, Box, Window, low_name


@dataclass(frozen=True)
class Variation:
    """How crops are drawn and varied; the defaults leave a window as it is."""

    noisy: float = 0.0
    """Share of crops whose low-resolution radiance is not denoised."""
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
    symmetries: bool = False
    """Flips, transposition and permutations of the colour channels."""


@dataclass(frozen=True)
class Crop:
    """Pictures of one place, float32 (height, width, 3), scene-linear."""

    low: Array
    reference: Array
    albedo: Array
    normal: Array
    guide_radiance: Array | None
    """Of `full` guides."""
    exposure: float

    def with_light(self, change: Callable[[Array], Array]) -> Crop:
        """Change the radiance."""
        guide = None if self.guide_radiance is None else change(self.guide_radiance)
        low, reference = change(self.low), change(self.reference)
        return replace(self, low=low, reference=reference, guide_radiance=guide)

    def with_colours(self, change: Callable[[Array], Array]) -> Crop:
        """Change radiance and albedo alike."""
        return replace(self.with_light(change), albedo=change(self.albedo))

    def with_pictures(self, change: Callable[[Array], Array]) -> Crop:
        """Change all pictures alike."""
        return replace(self.with_colours(change), normal=change(self.normal))


@dataclass(frozen=True)
class Batch:
    """What `XRDS.forward` takes and should give, radiance in the transfer domain."""

    radiance: Tensor  # (B, 3, h, w)
    guides: Tensor  # (B, 6 or 9, H, W)
    reference: Tensor  # (B, 3, H, W)

    @staticmethod
    def stack(batches: Sequence[Batch]) -> Batch:
        """Concatenate along B."""
        return Batch(
            torch.cat([b.radiance for b in batches]),
            torch.cat([b.guides for b in batches]),
            torch.cat([b.reference for b in batches]),
        )


def draw(
    window: Window,
    scale: int,
    guides: str,
    variation: Variation,
    random: np.random.Generator,
    size: int | None = None,
) -> Batch:
    """Cut one varied crop of `size` output pixels (None: the whole window)."""
    crop = cut(window, scale, guides, variation, random, size)
    if random.random() < variation.black:
        crop = crop.with_light(np.zeros_like)
    if variation.symmetries:
        crop = permute_colours(crop, random)
        crop = transpose_and_flip(crop, random)
    if variation.tint_stops:
        crop = tint(crop, variation.tint_stops, random)
    if random.random() < variation.rotated_normals:
        crop = replace(crop, normal=crop.normal @ random_rotation(random))
    return to_batch(crop)


def cut(
    window: Window,
    scale: int,
    guides: str,
    variation: Variation,
    random: np.random.Generator,
    size: int | None,
) -> Crop:
    """One crop of one low-resolution render and one quality of guides."""
    noisy = random.random() < variation.noisy
    name = low_name(scale, int(random.integers(LOW_RENDERS)), bool(noisy))
    stops = random.normal(0, variation.exposure_stops)
    exposure = window.exposures[name] * float(2**stops)
    low_box, box = boxes(window.arrays[name].shape, scale, size, random)
    albedo, normal = mix_guides(window, box, random)
    if random.random() < variation.shaded:
        low, reference = shade(mean_albedo(window, box), scale, exposure, random)
        guide_radiance = reference if guides == "full" else None
    else:
        low, _ = clean_radiance(window.array(name, low_box))
        reference, _ = clean_radiance(window.array("reference", box))
        guide_radiance = (
            noisy_radiance(window, box, random) if guides == "full" else None
        )
    return Crop(low, reference, albedo, normal, guide_radiance, exposure)


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


def noisy_radiance(window: Window, box: Box, random: np.random.Generator) -> Array:
    """The full-resolution radiance of one of the two guide renders."""
    which = "ab"[random.integers(2)]
    return clean_radiance(window.array(f"guide_radiance_{which}", box))[0]


def shade(
    albedo: Array, scale: int, exposure: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """Radiance of `albedo` under a smooth, coloured light: low-resolution and full."""
    stops = random.normal(0, 1, (1, 1, 4, 4)) + random.normal(0, 0.2, (1, 3, 1, 1))
    light = torch.nn.functional.interpolate(
        torch.from_numpy(np.exp2(stops)), size=albedo.shape[:2], mode="bicubic"
    )
    smooth = light[0].permute(1, 2, 0).clamp(min=0.05).numpy() / (4 * exposure)
    reference = (albedo * smooth).astype(np.float32)
    h, w = (n // scale for n in albedo.shape[:2])
    low = reference.reshape(h, scale, w, scale, 3).mean(axis=(1, 3))
    return low, reference


def permute_colours(crop: Crop, random: np.random.Generator) -> Crop:
    """The same permutation of the channels of radiance and albedo."""
    order = random.permutation(3)
    return crop.with_colours(lambda x: x[..., order])


def transpose_and_flip(crop: Crop, random: np.random.Generator) -> Crop:
    """One of the eight symmetries of the square; normals turn with the picture.

    Normals are in camera space, x to the right and y up, rows run downwards: so a
    transposed picture has x' = -y, y' = -x.
    """
    transposed, flip_y, flip_x = random.integers(2, size=3)
    turn = np.eye(3, dtype=np.float32)
    if transposed:
        crop = crop.with_pictures(lambda x: x.swapaxes(0, 1))
        turn = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, 1]], np.float32)
    if flip_y:
        crop = crop.with_pictures(lambda x: x[::-1])
        turn = turn * np.array([1, -1, 1], np.float32)
    if flip_x:
        crop = crop.with_pictures(lambda x: x[:, ::-1])
        turn = turn * np.array([-1, 1, 1], np.float32)
    return replace(crop, normal=crop.normal @ turn)


def tint(crop: Crop, stops: float, random: np.random.Generator) -> Crop:
    """Colour surfaces: a factor per channel, at most 1, on radiance and albedo.

    Of one bounce of light; longer paths would be tinted more than once.
    """
    factor = np.exp2(random.normal(0, stops, 3)).astype(np.float32)
    factor /= factor.max()
    return crop.with_colours(lambda x: x * factor)


def random_rotation(random: np.random.Generator) -> Array:
    """A rotation drawn uniformly: (3, 3)."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q.astype(np.float32)


def to_batch(crop: Crop) -> Batch:
    """A batch of one, radiance in the transfer domain."""
    guides = [crop.albedo, crop.normal]
    if crop.guide_radiance is not None:
        guides.append(transfer(crop.guide_radiance, crop.exposure))
    return Batch(
        to_tensor(transfer(crop.low, crop.exposure)),
        to_tensor(np.concatenate(guides, axis=-1)),
        to_tensor(transfer(crop.reference, crop.exposure)),
    )


def to_tensor(picture: Array) -> Tensor:
    """(H, W, C) to (1, C, H, W)."""
    channels_first = np.ascontiguousarray(picture.transpose(2, 0, 1), np.float32)
    return torch.from_numpy(channels_first)[None]
