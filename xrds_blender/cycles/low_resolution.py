"""The low-resolution render: its camera, its pixels, and what it leaves.

Every pixel is exactly scale x scale of the picture. The low-resolution frame is the
full one rounded up to whole pixels, so its camera sees a little more at the right and
at the bottom. Sensor, shift and ortho scale of the evaluated camera are changed
accordingly; the top left corner stays.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array

from ..internals.borrowed import Borrowed
from ..planning.settings import low_size


@dataclass(frozen=True)
class CameraFrame:
    """A camera frame in full-resolution pixels, with the pixels' shape."""

    width: int
    height: int
    aspect_x: float = 1.0
    aspect_y: float = 1.0

    def low_size(self, scale: int) -> tuple[int, int]:
        """Width and height in low-resolution pixels, rounded up."""
        return low_size(self.width, self.height, scale)

    def covered(self, scale: int) -> CameraFrame:
        """The frame that the low-resolution pixels cover."""
        width, height = self.low_size(scale)
        return CameraFrame(width * scale, height * scale, self.aspect_x, self.aspect_y)

    def fits_width(self, sensor_fit: str) -> bool:
        """Whether Blender lays the sensor along the width."""
        if sensor_fit == "AUTO":
            return self.width * self.aspect_x > self.height * self.aspect_y
        return sensor_fit == "HORIZONTAL"


@dataclass(frozen=True)
class Region:
    """A rectangle in pixels of the full-resolution frame, (0, 0) at the top left."""

    x: int
    y: int
    width: int
    height: int

    def low(self, scale: int) -> Region:
        """The whole low-resolution pixels that cover it, in their own grid."""
        x, y = self.x // scale, self.y // scale
        right = -(-(self.x + self.width) // scale)
        bottom = -(-(self.y + self.height) // scale)
        return Region(x, y, right - x, bottom - y)


@dataclass(frozen=True)
class LowGrid:
    """The pixels of a low-resolution picture, each exactly scale x scale.

    `window` are those wanted, in their own grid. `exact` is False for a panorama,
    whose frame cannot be widened: it is rendered in as many pixels as the grid has,
    but over the full frame, and resampled by normalised coordinates.
    """

    frame: CameraFrame
    scale: int
    window: Region
    exact: bool

    def offset(self, region: Region) -> tuple[int, int]:
        """Where `region` starts inside the window: (dy, dx), full-size pixels."""
        return (
            region.y - self.window.y * self.scale,
            region.x - self.window.x * self.scale,
        )

    def rendered(self, size: tuple[int, int]) -> Region:
        """The pixels to render, at most `size` (width, height) of them."""
        if self._is_aligned():
            return self.window
        x, width = self._span(1, self.window.x, self.window.width, size[0])
        y, height = self._span(0, self.window.y, self.window.height, size[1])
        return Region(x, y, width, height)

    def resample(self, picture: Array, rendered: Region) -> Array:
        """Rendered pixels (h, w, channels) to those of the window, bilinearly."""
        if self._is_aligned():
            return picture.copy()
        y = self._positions(0, self.window.y, self.window.height) - rendered.y
        x = self._positions(1, self.window.x, self.window.width) - rendered.x
        return interpolate(interpolate(picture, y, 0), x, 1)

    def _is_aligned(self) -> bool:
        return self.exact or self.frame.covered(self.scale) == self.frame

    def _positions(self, axis: int, first: int, count: int) -> NDArray[np.float64]:
        """Centres of grid pixels in rendered pixels, whose first centre is 0."""
        full = (self.frame.height, self.frame.width)[axis]
        low = -(-full // self.scale)
        centres = (np.arange(first, first + count) + 0.5) * self.scale / full
        return np.minimum(centres, 1.0) * low - 0.5

    def _span(self, axis: int, first: int, count: int, most: int) -> tuple[int, int]:
        full = (self.frame.height, self.frame.width)[axis]
        at = self._positions(axis, first, count)
        start = max(int(np.floor(at[0])), 0)
        stop = min(int(np.floor(at[-1])) + 2, -(-full // self.scale))
        return start, min(stop - start, most)


def interpolate(picture: Array, at: NDArray[np.float64], axis: int) -> Array:
    """Values at fractional positions along an axis, the edge repeated."""
    last = picture.shape[axis] - 1
    at = np.clip(at, 0, last)
    below = np.floor(at).astype(int)
    shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
    part = (at - below).astype(np.float32).reshape(shape)
    above = np.minimum(below + 1, last)
    return picture.take(below, axis) * (1 - part) + picture.take(above, axis) * part


@dataclass(frozen=True)
class Lens:
    """What of a camera decides the frame; `sensor` lies along the fitted side."""

    sensor: float
    ortho_scale: float
    shift_x: float
    shift_y: float


def widened(
    lens: Lens, along_width: bool, frame: CameraFrame, seen: CameraFrame
) -> Lens:
    """The lens that shows `seen`, a frame with the same top left corner.

    Shifts are in units of the fitted side, as Blender counts them.
    """
    if along_width:
        old, new = frame.width * frame.aspect_x, seen.width * seen.aspect_x
    else:
        old, new = frame.height * frame.aspect_y, seen.height * seen.aspect_y
    right = (seen.width - frame.width) / 2 * frame.aspect_x
    down = (seen.height - frame.height) / 2 * frame.aspect_y
    return Lens(
        lens.sensor * new / old,
        lens.ortho_scale * new / old,
        (lens.shift_x * old + right) / new,
        (lens.shift_y * old - down) / new,
    )


def is_exact(camera: Any) -> bool:
    """Whether the camera's frame can be widened; panoramas are resampled instead."""
    return camera.type in {"PERSP", "ORTHO"}


def widen(borrowed: Borrowed, camera: Any, frame: CameraFrame, scale: int) -> None:
    """Make the evaluated `camera` show `frame.covered(scale)`, until given back."""
    seen = frame.covered(scale)
    if not is_exact(camera) or seen == frame:
        return
    along_width = frame.fits_width(camera.sensor_fit)
    # AUTO measures by the sensor's width whichever side is longer.
    use_width = along_width or camera.sensor_fit == "AUTO"
    sensor = camera.sensor_width if use_width else camera.sensor_height
    old = Lens(sensor, camera.ortho_scale, camera.shift_x, camera.shift_y)
    new = widened(old, along_width, frame, seen)
    borrowed.set(
        camera,
        sensor_fit="HORIZONTAL" if along_width else "VERTICAL",
        **{"sensor_width" if along_width else "sensor_height": new.sensor},
        ortho_scale=new.ortho_scale,
        shift_x=new.shift_x,
        shift_y=new.shift_y,
    )


@dataclass(frozen=True)
class LowPlace:
    """Where the pixels of a low-resolution render lie, and what comes beside them.

    `window` are the pixels rendered, of `grid`; `offset` and `others` are as in
    `Beauty`. `seconds`: sync, beauty, denoise.
    """

    grid: LowGrid
    window: Region
    offset: tuple[int, int]
    others: dict[str, Array]
    seconds: dict[str, float]

    def beauty(self, picture: Array, noisy: Array | None = None) -> Beauty:
        """What the network takes, from radiance and alpha (h, w, 4) on the same grid.

        `noisy` (h, w, 3 or more) is the radiance before `picture` was denoised.
        """
        placed = self.grid.resample(picture, self.window)
        return Beauty(
            placed[..., :3].copy(),
            placed[..., 3].copy(),
            None if noisy is None else self.grid.resample(noisy, self.window)[..., :3],
            self.offset,
            self.seconds,
            self.others,
        )


@dataclass(frozen=True)
class LowSamples:
    """One view as Cycles sampled it, and where."""

    samples: Passes
    place: LowPlace

    def denoised(self, denoise: InProcess) -> Beauty:
        """Denoise before resampling: interpolated noise would count as texture."""
        started, given = time.perf_counter(), self.samples
        picture = denoise(given.picture, given.albedo, given.normal)
        self.place.seconds["denoise"] = time.perf_counter() - started
        return self.place.beauty(picture, given.picture)


InProcess = Callable[[Array, Array, Array], Array]
"""Denoises: radiance and alpha (h, w, 4), albedo, normal (h, w, 3) -> (h, w, 4)."""


@dataclass(frozen=True)
class Beauty:
    """The low-resolution radiance (h, w, 3), premultiplied, and alpha (h, w).

    `offset` (dy, dx): where the region starts inside the coverage, in full-resolution
    pixels. `seconds`: sync, beauty, denoise. `noisy` is None without denoising.
    """

    radiance: Array
    alpha: Array
    noisy: Array | None
    offset: tuple[int, int]
    seconds: dict[str, float] = field(default_factory=dict)
    others: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Guides:
    """Full-resolution albedo and normal (H, W, 3), alpha and depth (H, W).

    Albedo is as Cycles writes it, not clamped; normals are in camera space.
    `samples` are per pixel, None for guides without noise. `seconds`: sync, guides.
    """

    albedo: Array
    normal: Array
    alpha: Array
    depth: Array | None
    samples: int | None
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Probe:
    """Tiny guides, to compare with those of another render.

    `values` (N,) are all that guides keep, one pass after the other; `width` and
    `height` the size in pixels, `seconds` what the probe took.
    """

    values: Array
    width: int
    height: int
    seconds: float
