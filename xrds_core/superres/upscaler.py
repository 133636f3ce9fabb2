"""Pictures in, larger pictures out: weights, device, tiles, progress and cancel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import torch

from ..arrays import Array
from ..errors import OutOfMemory, WeightsError
from ..progress import Callback, Progress
from . import guide_noise, tiling
from .alpha import finish
from .cost import Cost, measure, watched
from .devices import (
    choose_device,
    choose_precision,
    device_name,
    free_memory,
    is_out_of_memory,
)
from .front_end import (
    LARGEST_TRANSFERRED,
    choose_exposure,
    inverse_transfer,
    to_picture,
)
from .idle import Area, busy_area, write_base
from .inputs import Inputs, check
from .network import XRDS
from .weights import choose_network

DEFAULT_MEMORY = 4 << 30
"""Bytes that an upscale takes on the CPU at most where no limit is given."""

# Tiles overlap by so many attention windows; the tests hold the seams to a bound.
_OVERLAP_WINDOWS = 5
# What the allocator of the C library loses to fragments, and what layers allocate for
# themselves: measured 0.4 to 1.3 times the tensors (`fast`), 1.6 (`balanced`) and 1.9
# (`paper`), on pictures of 256 to 2048 pixels squared.
_CPU_OVERHEAD = 2.0
_GPU_OVERHEAD = 1.5
# The base divides by albedo: radiance above this (a power of 2, so that nothing is
# rounded) is brought down before and back after, or it would leave float32.
_BRIGHT = 2.0**64
_LARGEST = np.float32(3.4e38)
_TILE_BYTES = 100.0  # per output pixel beside the network: guides, result, weights


@dataclass(frozen=True)
class Upscaled:
    """The result of an upscale."""

    radiance: Array
    """(H, W, 3), or (H, W, 4) premultiplied with alpha, scene-linear."""
    exposure: float
    """The factor used: pass it for other frames or borders of the same picture."""
    bad_pixels: int
    """Pixels of the inputs that held NaN, infinities or negative light."""
    tiles: int


class Upscaler:
    """A network on a device, ready for any number of pictures.

    Parameters
    ----------
    preset : {'paper', 'balanced', 'fast'}
        The network.
    scale : int
        Output pixels per low-resolution pixel along one axis.
    device : str
        `auto`, `cpu`, `metal`, or what torch knows: `cuda`, `cuda:1`.
    precision : {'auto', 'fp32', 'bf16'}
        Only the layers of the network ever run in bf16.
    weights : str, Path or XRDS, optional
        A folder of presets, a file, or a network, in place of the shipped ones.

    Raises
    ------
    WeightsError
        If the weights are missing, damaged or of another scale.
    UsageError
        If the device or precision is not there.
    """

    def __init__(
        self,
        preset: str = "fast",
        scale: int = 2,
        device: str = "auto",
        precision: str = "auto",
        weights: str | Path | XRDS | None = None,
    ) -> None:
        self.preset, self.device = preset, choose_device(device)
        self.precision = choose_precision(precision, self.device)
        self.network = choose_network(preset, scale, weights).to(self.device)

    @property
    def scale(self) -> int:
        """Output pixels per low-resolution pixel along one axis."""
        return self.network.config.scale

    @property
    def device_name(self) -> str:
        """Where it runs, as commands call it: `cpu`, `cuda:1`, `metal`."""
        return device_name(self.device)

    @cached_property
    def cost(self) -> Cost:
        """What the network costs per output pixel."""
        return measure(self.network)

    def __call__(
        self,
        radiance: Array,
        albedo: Array,
        normal: Array,
        *,
        noisy: Array | None = None,
        guide_alpha: Array | None = None,
        guide_samples: int | None = None,
        exposure: float | None = None,
        memory_limit: int | None = None,
        tile: int | None = None,
        progress: Callback | None = None,
        skip_idle: bool = True,
    ) -> Upscaled:
        """Enlarge one picture.

        Parameters
        ----------
        radiance : (h, w, 3) or (h, w, 4) float32 array
            Scene-linear, with alpha premultiplied.
        albedo : (H, W, 3) float32 array
            h = ceil(H / scale) and w = ceil(W / scale).
        normal : (H, W, 3) float32 array
            In camera space.
        noisy : (h, w, 3) float32 array, optional
            The radiance before it was denoised: shows how much of the guides' texture
            is in the light.
        guide_alpha : (H, W) float32 array, optional
            Alpha of the guides' render; in place of the picture's own, too, where
            `radiance` has none.
        guide_samples : int, optional
            Samples per pixel of albedo and normal; the noise of few of them is denoised
            first. None where they are many, or not known.
        exposure : float, optional
            Exposure of a picture that this is a part of; None finds it in `radiance`.
        memory_limit : int, optional
            Bytes to aim at, beside the arrays given and returned. The smallest tiles
            are taken where it is too small even for them.
        tile : int, optional
            Side of the tiles in low-resolution pixels, in place of a limit.
        progress : callable, optional
            Takes fractions from 0 to exactly 1; False as its result cancels.
        skip_idle : bool
            Whether the network leaves out areas to which it has nothing to add.

        Returns
        -------
        upscaled : Upscaled
            The picture, and the exposure that was used.

        Raises
        ------
        PictureError
            If the arrays do not fit each other or the scale.
        WeightsError
            If what the network gives is no picture.
        OutOfMemory
            If the device has no room even for the smallest tiles.
        Cancelled
            If `progress` returned False.
        """
        scale, given = self.scale, (radiance, albedo, normal, guide_alpha, noisy)
        inputs = check(scale, *given, guide_samples)
        exposure = choose_exposure(exposure, inputs.low)
        area = self._choose_area(inputs, skip_idle)
        device = self.device.type
        quiet = guide_noise.remover(guide_samples, device, memory_limit, progress)
        if quiet is not None and area is not None and not inputs.is_black():
            inputs = inputs.with_guides(quiet)
        plan = self._plan_tiles(area, memory_limit, tile)
        steps = Progress(progress)
        while True:
            try:
                picture = self._make_picture(inputs, area, exposure, plan, steps)
                return Upscaled(picture, exposure, inputs.bad_pixels, len(plan))
            except OutOfMemory:
                smaller = self._plan_smaller(area, plan)
                if smaller is None:
                    raise
                plan = smaller

    def _choose_area(self, inputs: Inputs, skip_idle: bool) -> Area | None:
        """Return the low-resolution rows and columns that the network is to see."""
        window = self.network.config.low_multiple
        if skip_idle and self.network.config.base:
            return busy_area(inputs, 2 * window, _OVERLAP_WINDOWS * window)
        height, width = inputs.low.shape[:2]
        return slice(0, height), slice(0, width)

    def _plan_tiles(
        self, area: Area | None, limit: int | None, side: int | None
    ) -> list[tiling.Tile]:
        if area is None:
            return []
        window = self.network.config.low_multiple
        overlap, multiple = _OVERLAP_WINDOWS * window, 2 * window
        height, width = (span.stop - span.start for span in area)
        if side is None:
            pixels = self._choose_memory(limit) / (
                self.bytes_per_pixel() * self.scale**2
            )
        else:
            pixels = side**2
        size = tiling.fit(height, width, pixels, overlap, multiple)
        return [
            tile.moved(area[0].start, area[1].start)
            for tile in tiling.tiles(height, width, size, overlap, multiple)
        ]

    def _plan_smaller(
        self, area: Area | None, plan: list[tiling.Tile]
    ) -> list[tiling.Tile] | None:
        """Return tiles of half the size, None where there are no smaller ones."""
        largest = tiling.largest(plan)
        smaller = self._plan_tiles(area, None, math.isqrt(largest // 2))
        return smaller if tiling.largest(smaller) < largest else None

    def _choose_memory(self, limit: int | None) -> float:
        if limit is not None:
            return limit
        free = 0.8 * free_memory(self.device)
        return free if self.device.type == "cuda" else min(DEFAULT_MEMORY, free)

    def bytes_per_pixel(self) -> float:
        """Return the memory that one output pixel of a tile takes at the most."""
        overhead = _CPU_OVERHEAD if self.device.type == "cpu" else _GPU_OVERHEAD
        return self.cost.bytes * overhead + _TILE_BYTES

    def _make_picture(
        self,
        inputs: Inputs,
        area: Area | None,
        exposure: float,
        plan: list[tiling.Tile],
        progress: Progress,
    ) -> Array:
        picture = np.zeros((*inputs.shape, inputs.low.shape[2]), np.float32)
        self._fill_idle(picture, inputs, area)
        progress.begin(self._count_work(plan))
        progress.report(0.0)
        if not inputs.is_black():
            with watched(self.network, progress):
                for tile in plan:
                    self._add_tile(picture, inputs, tile, exposure)
        if inputs.low.shape[2] == 4:
            finish(picture, inputs.low, inputs.guide_alpha, self.scale)
        progress.report(1.0)
        return picture

    def _fill_idle(self, picture: Array, inputs: Inputs, area: Area | None) -> None:
        """Write the base outside of `area`, which stays 0."""
        if area is not None and _area_size(area) == inputs.low.shape[:2]:
            return
        base = picture[..., :3]
        bright = np.float32(_BRIGHT if inputs.low.max() > _BRIGHT else 1.0)
        write_base(base, replace(inputs, low=inputs.low / bright))
        np.minimum(base, _LARGEST / bright, out=base)
        base *= bright
        if area is not None:
            rows, columns = (
                slice(s.start * self.scale, s.stop * self.scale) for s in area
            )
            picture[rows, columns, :3] = 0.0

    def _count_work(self, plan: list[tiling.Tile]) -> float:
        """Return the number of values that the layers will have returned."""
        window = self.network.config.low_multiple
        cells = sum(
            math.ceil(tile.rows.size / window) * math.ceil(tile.columns.size / window)
            for tile in plan
        )
        return cells * (window * self.scale) ** 2 * self.cost.values

    def _add_tile(
        self, picture: Array, inputs: Inputs, tile: tiling.Tile, exposure: float
    ) -> None:
        """Add one tile to the pixels it covers, with its blend weights."""
        result = self._run_tile(inputs, tile, exposure)
        rows = tile.rows.output(self.scale, picture.shape[0])
        columns = tile.columns.output(self.scale, picture.shape[1])
        target = picture[rows, columns, :3]
        height, width = target.shape[:2]
        share = tile.weights(self.scale)[:height, :width, None]
        target += result[:height, :width] * share

    def _run_tile(self, inputs: Inputs, tile: tiling.Tile, exposure: float) -> Array:
        """Return the radiance of one tile, (scale height, scale width, 3)."""
        bf16 = self.precision == torch.bfloat16
        try:
            with torch.inference_mode():
                guides = inputs.guide_tensor(tile).to(self.device)
                noisy = inputs.noisy_tensor(tile, exposure)
                with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16):
                    t = self.network(
                        inputs.radiance_tensor(tile, exposure).to(self.device),
                        guides,
                        None if noisy is None else noisy.to(self.device),
                    )
                if not bool((t.abs() <= LARGEST_TRANSFERRED).all()):
                    raise WeightsError(
                        "the network gives values that no picture has: its weights "
                        "are damaged; download them again"
                    )
                result = inverse_transfer(t, exposure).clamp_(min=0.0)
        except (RuntimeError, MemoryError) as error:
            if not is_out_of_memory(error):
                raise
            size = f"{tile.columns.size}x{tile.rows.size}"
            raise OutOfMemory(
                f"{self.device_name} has too little memory for a tile of {size} "
                "pixels: close other programs, or use a smaller preset or another "
                "device"
            ) from error
        return to_picture(result)


def _area_size(area: Area) -> tuple[int, ...]:
    return tuple(span.stop - span.start for span in area)


def upscale(
    radiance: Array,
    albedo: Array,
    normal: Array,
    *,
    scale: int = 2,
    preset: str = "fast",
    noisy: Array | None = None,
    alpha: Array | None = None,
    guide_samples: int | None = None,
    exposure: float | None = None,
    device: str = "auto",
    memory_limit: int | None = None,
    progress: Callback | None = None,
) -> Array:
    """Enlarge one picture with the shipped weights; the last network used stays loaded.

    Parameters
    ----------
    radiance : (h, w, 3) or (h, w, 4) float32 array
        Scene-linear, with alpha premultiplied.
    albedo, normal : (H, W, 3) float32 array
        Guides; h = ceil(H / scale) and w = ceil(W / scale).
    scale, preset, device
        Options of `Upscaler`.
    noisy, guide_samples, exposure, memory_limit, progress
        Options of a call of `Upscaler`.
    alpha : (H, W) float32 array, optional
        Alpha of the guides' render; the picture's own is the fourth channel of
        `radiance`.

    Returns
    -------
    radiance : (H, W, 3) or (H, W, 4) float32 array
        With either alpha (H, W, 4).

    Raises
    ------
    WeightsError, UsageError, PictureError, Cancelled
        For the reasons that `Upscaler` has.
    """
    return _get_upscaler(preset, scale, device)(
        radiance,
        albedo,
        normal,
        noisy=noisy,
        guide_alpha=alpha,
        guide_samples=guide_samples,
        exposure=exposure,
        memory_limit=memory_limit,
        progress=progress,
    ).radiance


@lru_cache(maxsize=1)
def _get_upscaler(preset: str, scale: int, device: str) -> Upscaler:
    return Upscaler(preset, scale, device)
