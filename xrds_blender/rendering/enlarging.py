"""From low-resolution pixels to those of the picture, by the network or without."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import OutOfMemory, WeightsError, XRDSError

from ..cycles.colour import converted, to_rec709, working_space
from ..cycles.low_resolution import Beauty, Guides
from ..planning.request import Machine, Request
from .loading import load_denoiser
from .picture import NetworkFailed

if TYPE_CHECKING:
    from xrds_core import Upscaled, Upscaler


def enlarge(
    beauty: Beauty,
    guides: Guides,
    request: Request,
    upscaler: Upscaler,
    *,
    exposure: float | None,
    skip_idle: bool,
    progress: Callable[[float], bool] | None = None,
) -> Array:
    """The region's radiance and alpha, (H, W, 4).

    Raises Cancelled where `progress` says so, and NetworkFailed.
    """
    rows, columns = beauty.offset
    matrix = to_rec709(working_space())

    def placed(guide: Array) -> Array:
        """Guides start where the first low-resolution pixel does."""
        margin = ((rows, 0), (columns, 0), *[(0, 0)] * (guide.ndim - 2))
        return np.pad(guide, margin, mode="edge")

    def seen(colour: Array) -> Array:
        """In the network's colour space."""
        return colour if matrix is None else converted(colour, matrix)

    try:
        upscaled: Upscaled = upscaler(
            seen(np.concatenate([beauty.radiance, beauty.alpha[..., None]], -1)),
            placed(seen(guides.albedo)),
            placed(guides.normal),
            noisy=None if beauty.noisy is None else seen(beauty.noisy),
            guide_alpha=placed(clean_alpha(guides, request.machine)),
            guide_samples=guides.samples,
            exposure=exposure,
            memory_limit=request.machine.memory_limit,
            progress=progress,
            skip_idle=skip_idle,
        )
    except (OutOfMemory, WeightsError, RuntimeError, MemoryError) as error:
        reason = str(error).partition("\n")[0] or "out of memory"
        message = (
            f"the network failed ({reason}); the picture is the low-resolution render"
        )
        raise NetworkFailed(message, beauty.radiance, beauty.alpha) from error
    region = upscaled.radiance[rows:, columns:]
    return region if matrix is None else converted(region, np.linalg.inv(matrix))


def enlarged_lights(
    lights: dict[str, Array],
    scale: int,
    offset: tuple[int, int],
    shape: tuple[int, ...],
) -> dict[str, Array]:
    """Low-resolution light passes (h, w, channels) on the picture's (H, W, ...)."""
    return {name: _bilinear(low, scale, offset, shape) for name, low in lights.items()}


def enlarged(
    beauties: dict[str, Beauty], scale: int, size: tuple[int, int]
) -> dict[str, Array]:
    """By view, the radiance and alpha of a region of `size` (H, W) without a network.

    They are (H, W, 4).
    """
    return {
        view: _bilinear(np.dstack((low.radiance, low.alpha)), scale, low.offset, size)
        for view, low in beauties.items()
    }


def _bilinear(
    low: Array, scale: int, offset: tuple[int, int], shape: tuple[int, ...]
) -> Array:
    """Enlarge (h, w, channels) without a network and cut the region out."""
    from xrds_core.superres.front_end import to_picture, to_planes, upsample_bilinear

    rows, columns = offset
    large = to_picture(upsample_bilinear(to_planes(low), scale))
    return large[rows : rows + shape[0], columns : columns + shape[1]]


def clean_alpha(guides: Guides, machine: Machine) -> Array:
    """Alpha (H, W) of the guides, denoised; as it is where nothing can denoise.

    Alpha is the share of samples that met something, so of four samples silhouettes
    are ragged and glass is mottled. The denoiser takes alpha for a grey picture. Where
    it is 0 or 1 all around a pixel it stays so.
    """
    alpha = np.clip(guides.alpha, 0.0, 1.0)
    if guides.samples is None or alpha.min() >= 1.0:
        return guides.alpha
    try:
        denoiser = load_denoiser("fast", machine)
    except XRDSError:
        return guides.alpha
    grey = np.repeat(alpha[..., None], 3, axis=2)
    smooth = np.clip(denoiser(grey).radiance[..., :3].mean(-1), 0.0, 1.0)
    return np.where(_is_even(alpha), alpha, smooth).astype(np.float32)


def _is_even(alpha: Array) -> Array:
    """Where a pixel and its eight neighbours are all 0 or all 1."""
    around = np.pad(alpha, 1, mode="edge")
    rows, columns = alpha.shape
    parts = [around[y : y + rows, x : x + columns] for y in range(3) for x in range(3)]
    return (np.min(parts, axis=0) >= 1.0) | (np.max(parts, axis=0) <= 0.0)
