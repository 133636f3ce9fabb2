"""One frame's samples and the camera that saw them: what accumulation works on.

Arrays are float32 (H, W, C), row 0 on top, radiance scene-linear. World space is the
renderer's; a camera looks along its own -Z with X to the right and Y up (OpenGL,
Blender). Pixel (0, 0) of an array covers [0, 1) in both directions, so that its centre
lies at (0.5, 0.5); y grows downwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import PictureError
from ..native.surfaces import find_rims
from .halves import Halves
from .local_filters import extreme
from .packing import pack, pack_counts, pack_parts, pack_vectors, pack_with_noise

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..arrays import Array
    from .noise import Noise

    Matrix = NDArray[np.float64]

# Blender writes 1e10 where no ray hits anything.
SKY_DEPTH = 1e9
# Relative to the surface's depth: how far behind it an image lies at least. Less is
# the slope of a surface, or the edge of something.
_BEHIND = 0.04
_PASSES = {"albedo": (3,), "normal": (3,), "depth": ()}
_OPTIONAL = {"radiance": (3,), "alpha": (), "vector": (4,), "counts": ()}
_OPTIONAL |= {"path_length": ()}


@dataclass(frozen=True)
class Sphere:
    """The part of the sphere of directions that a panorama's frame covers, in radians.

    Longitude grows to the right and is 0 straight ahead (-Z), latitude grows upwards.
    Cycles: the camera's `longitude_min` and so on.
    """

    longitude: tuple[float, float] = (-np.pi, np.pi)
    latitude: tuple[float, float] = (-np.pi / 2, np.pi / 2)


@dataclass(frozen=True)
class Camera:
    """A camera and the part of its frame that arrays hold.

    Perspective, orthographic, or with a `sphere` an equirectangular panorama, whose
    `project` is not used; other panoramas cannot be reprojected. `view` (4, 4) is the
    transform from world to camera space, `project` (4, 4) the one from there to OpenGL
    clip space (in Blender: `Object.calc_matrix_camera`). `size` is (width, height) of
    the whole frame in pixels, `window` the (x, y) of the arrays' top-left pixel in it:
    (0, 0) where no border crops the frame. No samples are reused between cameras of
    different names.
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
            (each.size, each.window, each.name, each.sphere) for each in (self, other)
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
        """Return the depth (H, W) of points in world space (H, W, 3).

        Points of exactly 0 are no hits, as in Cycles' Position pass: depth is infinite.
        """
        origin = np.linalg.inv(self.view)[:3, 3]
        away = position - origin.astype(np.float32)
        if self.sphere is None:
            depth = -(away @ self.view[2, :3])
        else:
            depth = np.linalg.norm(away, axis=-1)
        hit = (position != 0.0).any(axis=-1)
        return np.where(hit, depth, np.inf).astype(np.float32)


@dataclass(frozen=True)
class Frame:
    """One frame as the renderer returns it; its arrays are never changed.

    `radiance` is None in a frame of guides alone: the guides then decide whether two
    frames show the same. `number` is the frame's number: `vector` points to number - 1
    and number + 1, and frames of one number show one moment (the views of a stereo
    pair). `samples` per pixel weight the frame against others. `normal` is in camera
    space, but with Z pointing away from the viewer, as in Cycles' `Denoising Normal`.
    `depth` (H, W) is the distance of the first hit from the camera, along the camera's
    axis (of a panorama along the ray), at each pixel's centre; infinite, or above 1e9,
    without a hit.

    `still` says that nothing at all moves or changes from frame to frame, not even
    light: frames of equal cameras differ in their noise alone.

    Optional: `alpha` (H, W); `vector` (H, W, 4), Cycles' Vector pass: the surface's
    position one frame before minus its position now, then its position now minus the
    one a frame later, in pixels, y upwards; without it all surfaces are assumed to
    stand still. `counts` (H, W): samples of each pixel, where they differ; `samples` is
    their mean. `halves` are the half buffers, from which noise is estimated better than
    from the surrounding pixels. `path_length` (H, W): the way from the camera, through
    mirrors and glass, to what albedo and normal show (Cycles' `Denoising Depth`).
    `subset` is the number of the part that the frame has of a sequence that frames
    share: two with the same have the same noise. None of a sequence of its own.
    """

    number: int
    camera: Camera
    radiance: Array | None
    albedo: Array
    normal: Array
    depth: Array
    samples: float = 1.0
    alpha: Array | None = None
    vector: Array | None = None
    still: bool = False
    counts: Array | None = None
    halves: Halves | None = None
    path_length: Array | None = None
    parts: Mapping[str, Array] = field(default_factory=dict)
    subset: int | None = None

    def __post_init__(self) -> None:
        shapes = _PASSES | _OPTIONAL
        arrays = [(name, getattr(self, name), shapes[name]) for name in shapes]
        arrays += [(name, part, (3,)) for name, part in self.parts.items()]
        for name, array, channels in arrays:
            if array is not None and array.shape != self.shape + channels:
                raise PictureError(
                    f"{name} of frame {self.number} has shape {array.shape} where its "
                    f"normal requires {self.shape + channels}: give passes of one "
                    "render"
                )
        if not self.samples > 0:
            raise PictureError(
                f"frame {self.number} has {self.samples} samples per pixel: give the "
                "number it was rendered with"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of every array."""
        return self.normal.shape[0], self.normal.shape[1]


@dataclass(frozen=True, eq=False)
class Stored:
    """A frame as the window stores it: flat, packed, and free of NaN.

    `picture` (H W, 6 to 10) holds radiance (not in a frame of guides alone), albedo,
    normal and alpha (if any), in half floats to save memory. `inverse_depth` (H W) is
    1 / depth, 0 without a hit; the depth itself for an orthographic camera; NaN where
    unknown. `invalid` (H W) is the validity mask, negated: pixels that held NaN or
    infinities and are 0 now; None if there were none. `counts` (H W): samples of each
    pixel where they differ. `noise` is None in a frame of guides
    alone. `image` (H W) is as `inverse_depth`, of the image that a mirror or glass
    shows, NaN where there is none; None if there is none anywhere. `parts` (H W, 3), by
    name, are light that the radiance is made of; None for one that is dark everywhere.
    """

    number: int
    camera: Camera
    shape: tuple[int, int]
    samples: float
    picture: NDArray[np.float16]
    inverse_depth: Array
    invalid: NDArray[np.bool_] | None = None
    vector: NDArray[np.float16] | None = None
    still: bool = False
    counts: NDArray[np.float16] | None = None
    noise: Noise | None = None
    image: Array | None = None
    parts: Mapping[str, NDArray[np.float16] | None] = field(default_factory=dict)

    @property
    def has_light(self) -> bool:
        """Whether there is radiance before albedo and normal."""
        return self.picture.shape[1] >= 9

    @property
    def normals(self) -> slice:
        """The channels of `picture` with normals; albedo lies before them."""
        return slice(6, 9) if self.has_light else slice(3, 6)

    @cached_property
    def rims(self) -> NDArray[np.uint8]:
        """(H W): pixels next to a nearer surface, some of whose light they contain.

        0, or 1 + which of the 3x3 pixels around has the nearest surface.
        """
        return find_rims(self.inverse_depth, self.shape, self.camera.orthographic)

    @property
    def is_empty(self) -> bool:
        """Whether no pixel has a sample, as in a reprojected placeholder."""
        return self.invalid is not None and bool(self.invalid.all())

    def shows_same(self, other: Stored) -> bool:
        """Whether two frames differ in their noise alone."""
        return self.still and other.still and self.camera.same(other.camera)


def pack_frame(
    frame: Frame,
) -> tuple[NDArray[np.float16], NDArray[np.bool_], Noise | None]:
    """Return `Stored.picture`, its invalid pixels, and the noise, 0 at these.

    There is none of guides alone.
    """
    passes = frame.radiance, frame.albedo, frame.normal, frame.alpha
    if frame.radiance is None:
        return *pack(*passes), None
    return pack_with_noise(passes, frame.samples, frame.halves)


def store(frame: Frame) -> Stored:
    """Pack a frame; pixels with NaN or infinities in any pass are invalid.

    Values beyond +-65504, the largest half float, are clipped.
    """
    picture, invalid, noise = pack_frame(frame)
    return Stored(
        number=frame.number,
        camera=frame.camera,
        shape=frame.shape,
        samples=frame.samples,
        picture=picture,
        inverse_depth=_inverse_depth(frame),
        invalid=invalid if invalid.any() else None,
        vector=None if frame.vector is None else pack_vectors(frame.vector),
        still=frame.still,
        counts=None if frame.counts is None else pack_counts(frame.counts),
        noise=noise,
        image=_image(frame),
        parts=pack_parts(frame.parts),
    )


def _inverse_depth(frame: Frame) -> Array:
    """Return `Stored.inverse_depth`; NaN for a depth of NaN or below 0."""
    depth = frame.depth.ravel().astype(np.float32)
    sky = depth > SKY_DEPTH
    if frame.camera.orthographic:
        # an orthographic camera sees the sky in one direction only: nothing to track
        return np.where(sky, np.float32(np.nan), depth)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = np.where(
            depth > 0.0, np.float32(1.0) / depth, np.float32(np.nan)
        )
    inverse_depth[sky] = 0.0
    return inverse_depth


def _image(frame: Frame) -> Array | None:
    """Return `Stored.image`: where paths end well behind the surface they start at."""
    if frame.path_length is None:
        return None
    depth = frame.depth
    end = frame.path_length * frame.camera.depth_per_length(frame.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        behind = end > extreme(depth, np.fmax) * np.float32(1.0 + _BEHIND)
        behind &= (depth > 0.0) & (end < SKY_DEPTH)
    if not behind.any():
        return None
    image = np.where(behind, end, np.float32(np.nan)).ravel()
    return image if frame.camera.orthographic else np.float32(1.0) / image
