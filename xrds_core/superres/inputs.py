"""The arrays given to an upscale: checked, cleaned, and cut into tiles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..arrays import Array, float_array
from ..errors import PictureError, UsageError
from ..holes import clean_alpha, fill_holes
from .front_end import clean_radiance, pad_guide, to_planes, transfer
from .guide_noise import Quiet
from .tiling import Tile

_SCALES = (1, 2, 4, 8, 16)  # to propose in a message


@dataclass(frozen=True)
class Inputs:
    """One picture and its guides, without NaN, infinities or negative radiance."""

    scale: int
    low: Array
    """Radiance (h, w, 3), or (h, w, 4) with alpha."""
    noisy: Array | None
    """Radiance (h, w, 3) before denoising."""
    albedo: Array
    """(H, W, 3), as the normal; scale (h - 1) < H <= scale h, and so W."""
    normal: Array
    guide_alpha: Array | None
    """(H, W)"""
    bad_pixels: int

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the result."""
        return self.albedo.shape[0], self.albedo.shape[1]

    def is_black(self) -> bool:
        """Whether there is no light at all in the picture."""
        return not self.low[..., :3].any()

    def with_guides(self, quiet: Quiet) -> Inputs:
        """The same with albedo and normal as `quiet` makes them of these."""
        albedo, normal = quiet(self.albedo, self.normal)
        return replace(self, albedo=albedo, normal=normal)

    def radiance_tensor(self, tile: Tile, exposure: float) -> Tensor:
        """Return the radiance of a tile in the transfer domain, (1, 3, h, w)."""
        return _low_tensor(self.low, tile, exposure)

    def noisy_tensor(self, tile: Tile, exposure: float) -> Tensor | None:
        """Return the same before denoising, or None."""
        return None if self.noisy is None else _low_tensor(self.noisy, tile, exposure)

    def guide_tensor(self, tile: Tile) -> Tensor:
        """Return the guides of a tile as the network takes them, (1, 6, H, W).

        Where they end before the low-resolution picture does, their edge is repeated.
        """
        albedo, normal = (
            to_planes(self._cut_tile(x, tile)) for x in (self.albedo, self.normal)
        )
        return torch.cat((albedo.clamp(0.0, 1.0), normal.clamp(-1.0, 1.0)), dim=1)

    def _cut_tile(self, guide: Array, tile: Tile) -> Array:
        spans = (tile.rows, tile.columns)
        rows, columns = (
            span.output(self.scale, limit)
            for span, limit in zip(spans, self.shape, strict=True)
        )
        cut = guide[rows, columns]
        missing = [
            (0, span.size * self.scale - size)
            for span, size in zip(spans, cut.shape, strict=False)
        ]
        if not any(after for _, after in missing):
            return cut
        return np.pad(cut, (*missing, (0, 0)), "edge")


def _low_tensor(low: Array, tile: Tile, exposure: float) -> Tensor:
    """(h, w, C) -> tensor of a tile, (1, 3, h, w), in the transfer domain."""
    rows, columns = tile.rows, tile.columns
    cut = low[rows.start : rows.stop, columns.start : columns.stop, :3]
    return transfer(to_planes(cut), exposure)


def check(
    scale: int,
    radiance: Any,
    albedo: Any,
    normal: Any,
    guide_alpha: Any = None,
    noisy: Any = None,
    guide_samples: int | None = None,
) -> Inputs:
    """Check and clean the arrays given to an upscale.

    Parameters
    ----------
    scale : int
        Output pixels per low-resolution pixel along one axis.
    radiance : array_like
        (h, w, 3), or (h, w, 4) premultiplied; scene-linear floats.
    albedo, normal : array_like
        (H, W, 3) floats.
    guide_alpha : array_like, optional
        (H, W) or (H, W, 1) floats.
    noisy : array_like, optional
        (h, w, 3), the radiance before it was denoised.
    guide_samples : int, optional
        Samples per pixel of the guides.

    Returns
    -------
    inputs : Inputs
        Float32 arrays without a fault are not copied.

    Raises
    ------
    PictureError
        If arrays do not fit; it states their sizes and the remedy.
    UsageError
        If guides have less than a sample.
    """
    if guide_samples is not None and guide_samples < 1:
        raise UsageError(f"guide_samples is {guide_samples}; it must be 1 or more")
    low = float_array("radiance", radiance, (3, 4))
    guides = {
        "albedo": float_array("albedo", albedo, (3,)),
        "normal": float_array("normal", normal, (3,)),
    }
    if guide_alpha is not None:
        plane = np.asarray(guide_alpha)
        plane = plane[..., None] if plane.ndim == 2 else plane
        guides["guide_alpha"] = float_array("guide_alpha", plane, (1,))
    _check_sizes(scale, low, guides)
    cleaned = {
        name: (clean_alpha if name == "guide_alpha" else fill_holes)(guide)
        for name, guide in guides.items()
    }
    before, faults = (None, 0) if noisy is None else _clean_noisy(noisy, low)
    low, bad_pixels = _clean_picture(low)
    bad_pixels += faults + sum(count for _, count in cleaned.values())
    cover, _ = cleaned.get("guide_alpha", (None, 0))
    if cover is not None and low.shape[2] == 3:
        low = np.concatenate((low, _downsample_alpha(cover, low, scale)), axis=2)
    return Inputs(
        scale,
        low,
        before,
        cleaned["albedo"][0],
        cleaned["normal"][0],
        None if cover is None else cover[..., 0],
        bad_pixels,
    )


def _clean_picture(low: Array) -> tuple[Array, int]:
    """Return the picture, cleaned, and its bad pixels; bad alpha spoils no colour."""
    cleaned, bad = clean_radiance(low)
    if not bad or low.shape[2] == 3:
        return cleaned, bad
    colour, _ = clean_radiance(low[..., :3])
    alpha, _ = clean_alpha(low[..., 3:])
    return np.concatenate((colour, alpha.clip(0.0)), axis=2), bad


def _clean_noisy(value: Any, low: Array) -> tuple[Array, int]:
    """Return the radiance before denoising, cleaned, and its bad pixels."""
    noisy = float_array("noisy", value, (3,))
    if noisy.shape[:2] != low.shape[:2]:
        raise PictureError(
            f"noisy is {_size_text(noisy)} pixels, but radiance is {_size_text(low)}: "
            "give both from the same render"
        )
    return clean_radiance(noisy)


def _downsample_alpha(cover: Array, low: Array, scale: int) -> Array:
    """Return what the guides' alpha (H, W, 1) is at low resolution, (h, w, 1)."""
    height, width = low.shape[:2]
    whole = pad_guide(cover, low, scale)
    blocks = whole.reshape(height, scale, width, scale, 1)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _check_sizes(scale: int, low: Array, guides: dict[str, Array]) -> None:
    albedo = guides["albedo"]
    for name, guide in guides.items():
        if guide.shape[:2] != albedo.shape[:2]:
            raise PictureError(
                f"{name} is {_size_text(guide)} pixels, but albedo is "
                f"{_size_text(albedo)}: give guides from the same render"
            )
    if not _fits(scale, low, albedo):
        other = [s for s in _SCALES if _fits(s, low, albedo)]
        raise PictureError(
            f"the guides are {_size_text(albedo)} pixels, but radiance of "
            f"{_size_text(low)} at scale {scale} needs guides of "
            f"{_size_text(low, scale)}, or fewer than {scale} pixels less: render them "
            "at that size" + (f", or use scale {other[0]}" if other else "")
        )


def _fits(scale: int, low: Array, guide: Array) -> bool:
    return low.shape[:2] == tuple(-(-size // scale) for size in guide.shape[:2])


def _size_text(picture: Array, scale: int = 1) -> str:
    return f"{picture.shape[1] * scale}x{picture.shape[0] * scale}"
