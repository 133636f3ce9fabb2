"""Equirectangular panoramas: pixels are directions, and depth is distance.

The reprojection of a panorama is not linear in its pixels, as that of other cameras
is, but in their directions: unit vectors in camera space.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..arrays import Array
    from .frame import Camera, Matrix


@dataclass(frozen=True)
class PanoramaReprojection:
    """The reprojection of pixels from one panorama to another.

    `turn` (4, 4) is the transform from the camera space of `here` to that of `there`.
    """

    here: Camera
    there: Camera
    turn: Matrix

    def reproject(
        self, x: Array, y: Array, inverse_depth: Array
    ) -> tuple[Array, Array, Array]:
        """Return (x, y, inverse depth) there of pixels (n,) here."""
        ray = _directions(self.here, x, y)
        turn = self.turn.astype(np.float32)
        seen = turn[:3, :3] @ ray + turn[:3, 3:] * inverse_depth
        length = np.sqrt(np.square(seen).sum(0))
        with np.errstate(divide="ignore", invalid="ignore"):
            across, down = _pixels(self.there, seen / length)
            return across, down, inverse_depth / length

    def directions(self, shape: tuple[int, int]) -> tuple[Array, Array]:
        """Return sine and cosine of the longitude of each column (W, 2) of `here`, and
        of the latitude of each row (H, 2).
        """
        half = np.float32(0.5)
        x, y = (np.arange(n, dtype=np.float32) + half for n in shape[::-1])
        longitude, latitude = _angles(self.here, x, y)
        columns, rows = (
            np.stack([np.sin(angle), np.cos(angle)], axis=-1)
            for angle in (longitude, latitude)
        )
        return columns, rows

    @property
    def first(self) -> tuple[float, float]:
        """Longitude and latitude of the top left corner of the whole frame `there`."""
        sphere = self.there.sphere
        assert sphere is not None
        return sphere.longitude[0], sphere.latitude[1]

    @property
    def density(self) -> tuple[float, float]:
        """Pixels per radian `there`, across and down."""
        sphere, (width, height) = self.there.sphere, self.there.size
        assert sphere is not None
        (left, right), (low, high) = sphere.longitude, sphere.latitude
        return width / (right - left), height / (high - low)


def panorama_reprojection(here: Camera, there: Camera) -> PanoramaReprojection:
    """Return the reprojection between two panoramas."""
    return PanoramaReprojection(here, there, there.view @ np.linalg.inv(here.view))


def _directions(camera: Camera, x: Array, y: Array) -> Array:
    """Return unit vectors (3, n) in camera space."""
    longitude, latitude = _angles(camera, x, y)
    level = np.cos(latitude)
    ahead = -level * np.cos(longitude)
    return np.stack([level * np.sin(longitude), np.sin(latitude), ahead])


def _angles(camera: Camera, x: Array, y: Array) -> tuple[Array, Array]:
    """Return longitude and latitude of columns and rows of pixels."""
    sphere, (width, height) = camera.sphere, camera.size
    assert sphere is not None
    (left, right), (low, high) = sphere.longitude, sphere.latitude
    longitude = left + (x + camera.window[0]) * np.float32((right - left) / width)
    latitude = high - (y + camera.window[1]) * np.float32((high - low) / height)
    return longitude, latitude


def _pixels(camera: Camera, ray: Array) -> tuple[Array, Array]:
    """Return the pixels (x, y) that show unit vectors (3, n)."""
    sphere, (width, height) = camera.sphere, camera.size
    assert sphere is not None
    (left, right), (low, high) = sphere.longitude, sphere.latitude
    longitude = np.arctan2(ray[0], -ray[2])
    # the same direction, measured from the frame's left edge
    turned = np.mod(longitude - np.float32(left), np.float32(2 * np.pi))
    latitude = np.arcsin(np.clip(ray[1], -1.0, 1.0))
    x = turned * np.float32(width / (right - left)) - camera.window[0]
    y = (high - latitude) * np.float32(height / (high - low)) - camera.window[1]
    return x.astype(np.float32), y.astype(np.float32)
