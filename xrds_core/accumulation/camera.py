"""Cameras as matrices, and the shot cuts that they show.

No samples are reused across a shot cut, whatever the pictures look like. A change to
another camera, camera type or frame size, a jump of the focal length and a view that
swings away within one frame are cuts; a zoom, a fast pan and a change of the render
border are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array

    Matrix = NDArray[np.float64]


# Factor by which the focal length may change from one frame to the next.
_ZOOM = 1.25
# Share of the field of view by which a camera may turn from one frame to the next.
_TURN = 0.5


def is_shot_cut(before: Camera, after: Camera) -> bool:
    """Whether there is a shot cut between two consecutive frames."""
    if _kind(before) != _kind(after):
        return True
    if before.sphere is not None:  # a panorama sees everything
        return False
    old, new = (np.abs(np.diag(c.project)[:2]) for c in (before, after))
    if (np.maximum(old / new, new / old) > _ZOOM).any():
        return True
    cosine = before.view[2, :3] @ after.view[2, :3]
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    seen = np.pi if before.orthographic else 2 * np.arctan(1 / min(*old, *new))
    return bool(angle > _TURN * seen)


def _kind(camera: Camera) -> tuple[object, ...]:
    return camera.name, camera.orthographic, camera.sphere, camera.size


# Blender writes 1e10 where no ray hits anything.
SKY_DEPTH = 1e9


@dataclass(frozen=True)
class Sphere:
    """The part of the sphere of directions that a panorama's frame covers.

    Cycles' camera calls these angles `longitude_min` and so on.

    Attributes
    ----------
    longitude : tuple of float
        Left and right edge in radians; 0 is straight ahead (-Z), growing to the right.
    latitude : tuple of float
        Lower and upper edge in radians, growing upwards.
    """

    longitude: tuple[float, float] = (-np.pi, np.pi)
    latitude: tuple[float, float] = (-np.pi / 2, np.pi / 2)


@dataclass(frozen=True)
class Camera:
    """A camera and the part of its frame that arrays hold.

    It is perspective, orthographic or, with a `sphere`, an equirectangular panorama.
    Other panoramas cannot be reprojected.

    Attributes
    ----------
    view : (4, 4) float64 array
        Transform from world to camera space.
    project : (4, 4) float64 array
        Transform from camera space to OpenGL clip space (`Object.calc_matrix_camera` in
        Blender). Not used for a panorama.
    size : tuple of int
        Width and height of the whole frame in pixels.
    window : tuple of int
        (x, y) of the arrays' top-left pixel in the whole frame; (0, 0) where no border
        crops the frame.
    name : str
        No samples are reused between cameras of different names.
    sphere : Sphere or None
        What a panorama covers, None for other cameras.
    """

    view: Matrix
    project: Matrix
    size: tuple[int, int]
    window: tuple[int, int] = (0, 0)
    name: str = ""
    sphere: Sphere | None = None

    def same(self, other: Camera) -> bool:
        """Whether both see the same scene point in every pixel."""
        kind, others = (
            (camera.size, camera.window, camera.name, camera.sphere)
            for camera in (self, other)
        )
        return (
            kind == others
            and np.array_equal(self.view, other.view)
            and np.array_equal(self.project, other.project)
        )

    @property
    def orthographic(self) -> bool:
        return self.sphere is None and bool(self.project[3, 3] != 0.0)

    def depth_per_length(self, shape: tuple[int, int]) -> Array:
        """Return depth per unit of length along the ray of each pixel (H, W)."""
        if self.sphere is not None or self.orthographic:
            return np.ones(shape, np.float32)
        (width, height), (left, top), p = self.size, self.window, self.project
        x = (np.arange(shape[1]) + left + 0.5) / width * 2 - 1
        y = 1 - (np.arange(shape[0]) + top + 0.5) / height * 2
        across, down = (x + p[0, 2]) / p[0, 0], (y + p[1, 2]) / p[1, 1]
        square = 1.0 + np.square(across) + np.square(down)[:, None]
        return np.asarray(1.0 / np.sqrt(square), np.float32)

    def depth(self, position: Array) -> Array:
        """Return the depth of points in world space.

        Parameters
        ----------
        position : (H, W, 3) float32 array
            World positions. Points of exactly 0 are no hits, which is how Cycles'
            Position pass marks them.

        Returns
        -------
        depth : (H, W) float32 array
            Distance along the camera's axis, of a panorama along the ray; infinite
            where nothing is hit.
        """
        origin = np.linalg.inv(self.view)[:3, 3]
        away = position - origin.astype(np.float32)
        if self.sphere is None:
            depth = -(away @ self.view[2, :3])
        else:
            depth = np.linalg.norm(away, axis=-1)
        hit = (position != 0.0).any(axis=-1)
        return np.where(hit, depth, np.inf).astype(np.float32)
