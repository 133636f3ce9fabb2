"""Reprojection: where every pixel of one frame was in another one.

A pixel's centre and depth give a point in the world, which the other frame's camera
shows elsewhere. That is linear in (x, y, 1, inverse depth), so one 4x4 matrix for each
pair of frames describes it. Inverse depth is 1 / depth for a perspective camera, 0 for
the sky; for an orthographic camera the depth takes its place. Of equirectangular
panoramas it is linear in directions: unit vectors in camera space.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from .camera import Camera
from .frame import Stored
from .local_filters import extreme, find_ranges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .camera import Camera
    from .frame import Matrix, Stored

    Reprojection: TypeAlias = "Array | PanoramaReprojection"
    from collections.abc import Sequence


@dataclass(frozen=True)
class PanoramaReprojection:
    """The reprojection of pixels from one panorama to another.

    Attributes
    ----------
    here, there : Camera
        The panorama of the pixels, and the one that they are reprojected to.
    turn : (4, 4) float64 array
        Transform from the camera space of `here` to that of `there`.
    """

    here: Camera
    there: Camera
    turn: Matrix

    def reproject(
        self, x: Array, y: Array, inverse_depth: Array
    ) -> tuple[Array, Array, Array]:
        """Reproject pixels from one panorama to the other.

        Parameters
        ----------
        x, y : (n,) float32 array
            Positions here, in pixels.
        inverse_depth : (n,) float32 array
            Inverse depth here.

        Returns
        -------
        x, y, inverse_depth : (n,) float32 array
            The same there.
        """
        ray = _find_directions(self.here, x, y)
        turn = self.turn.astype(np.float32)
        seen = turn[:3, :3] @ ray + turn[:3, 3:] * inverse_depth
        length = np.sqrt(np.square(seen).sum(0))
        with np.errstate(divide="ignore", invalid="ignore"):
            across, down = _find_pixels(self.there, seen / length)
            return across, down, inverse_depth / length

    def directions(self, shape: tuple[int, int]) -> tuple[Array, Array]:
        """Return the directions that the columns and rows of a picture show.

        Parameters
        ----------
        shape : tuple of int
            Height and width of a picture of `here`.

        Returns
        -------
        columns : (W, 2) float32 array
            Sine and cosine of the longitude of each column.
        rows : (H, 2) float32 array
            Sine and cosine of the latitude of each row.
        """
        half = np.float32(0.5)
        x, y = (np.arange(n, dtype=np.float32) + half for n in shape[::-1])
        longitude, latitude = _find_angles(self.here, x, y)
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


def _find_directions(camera: Camera, x: Array, y: Array) -> Array:
    """Return unit vectors (3, n) in camera space."""
    longitude, latitude = _find_angles(camera, x, y)
    level = np.cos(latitude)
    ahead = -level * np.cos(longitude)
    return np.stack([level * np.sin(longitude), np.sin(latitude), ahead])


def _find_angles(camera: Camera, x: Array, y: Array) -> tuple[Array, Array]:
    """Return longitude and latitude of columns and rows of pixels."""
    sphere, (width, height) = camera.sphere, camera.size
    assert sphere is not None
    (left, right), (low, high) = sphere.longitude, sphere.latitude
    longitude = left + (x + camera.window[0]) * np.float32((right - left) / width)
    latitude = high - (y + camera.window[1]) * np.float32((high - low) / height)
    return longitude, latitude


def _find_pixels(camera: Camera, ray: Array) -> tuple[Array, Array]:
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


# Pixels by which forward and backward motion of moving objects may differ; half as much
# as of what stands still, for their edges are known less well.
MOVING_TOLERANCE = 0.5
# Cycles' first sample lies at the pixel's centre. Frames of a sample or two that move
# by whole pixels would all show the same points, and lines thinner than a pixel would
# break up. So there the pixel taken is jittered. Motion counts as
# whole pixels where a position is nearer to a centre than this, per frame between.
FEW_SAMPLES = 2.0
_WHOLE = 0.02
# Distance between spots along each axis, in small and large pictures.
_STRIDES, _LARGE = (2, 4), 1_000_000


@dataclass(frozen=True)
class Grid:
    """The centres of some pixels (n,): of whole rows, or of any."""

    pixels: slice | NDArray[np.intp]
    x: Array
    y: Array


@dataclass(frozen=True)
class Places:
    """The pixels of another frame that positions fall into, in their order.

    Attributes
    ----------
    pixel : (n,) int32 array
        Flat index; 0 where not `seen`.
    seen : (n,) bool array
        False for positions outside the frame.
    """

    pixel: NDArray[np.int32]
    seen: NDArray[np.bool_]


@dataclass(frozen=True)
class ObjectMotion:
    """Where the moving objects of one frame were in another one.

    In a `Pair` the edges of moving objects are included.

    Attributes
    ----------
    pixels : (m,) int array
        Flat, ascending: the pixels of this frame that show moving objects.
    x, y : (m,) float32 array
        Where they were in the other frame, in pixels; NaN where forward and backward
        motion are inconsistent.
    moving : (H W,) bool array
        The pixels of the other frame that show moving objects.
    """

    pixels: NDArray[np.intp]
    x: Array
    y: Array
    moving: NDArray[np.bool_]

    @property
    def is_empty(self) -> bool:
        """Whether neither frame shows anything that moves by itself."""
        return not len(self.pixels) and not self.moving.any()


@dataclass(frozen=True)
class Pair:
    """Two frames, and the reprojection of pixels from one to the other and back.

    Attributes
    ----------
    here : Stored
        The frame that samples are gathered for.
    there : Stored
        Its neighbour.
    forth, back : (4, 4) float32 array or PanoramaReprojection
        Reprojection from `here` to `there`, and from `there` to `here`.
    extent : tuple of (H W,) float32 arrays
        Least and largest inverse depth around each pixel of `here`, from `find_ranges`.
    object_motion : ObjectMotion or None
        None where nothing but the camera moves.
    """

    here: Stored
    there: Stored
    forth: Reprojection
    back: Reprojection
    extent: tuple[Array, Array]
    object_motion: ObjectMotion | None = None

    @cached_property
    def turn(self) -> Array | None:
        """(3, 3): normals of `there` in the axes of `here`; None if identical."""
        here, there = self.here.camera, self.there.camera
        turn = here.view[:3, :3] @ np.linalg.inv(there.view[:3, :3])
        turn = _normal_axes(here) @ turn @ _normal_axes(there).T
        same = np.allclose(turn, np.eye(3), atol=1e-7)
        return None if same else turn.astype(np.float32)

    @property
    def leads(self) -> bool:
        """Whether edges move with the nearer of their sides.

        What lies behind moves otherwise; where samples are few, its errors count more.
        """
        return self.here.samples > FEW_SAMPLES

    @property
    def jitters(self) -> bool:
        """Whether the pixels taken are jittered where places lie at pixel centres."""
        here, there = self.here, self.there
        is_static = here.camera.same(replace(there.camera, window=here.camera.window))
        moment = here.number == there.number
        return not (self.leads or is_static or moment)

    @property
    def whole_motion(self) -> float:
        """The squared distance to a pixel's centre up to which a place lies there."""
        return (_WHOLE * abs(self.there.number - self.here.number)) ** 2


def _normal_axes(camera: Camera) -> Matrix:
    """Return (3, 3): from the axes of view matrices to those of Cycles' normals.

    In the latter Z points away from the viewer; in panoramas X does, and Z upwards.
    """
    if camera.sphere is None:
        return np.diag([1.0, 1.0, -1.0])
    return np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def world_of(camera: Camera) -> Matrix:
    """Return (4, 4): (x, y, 1, inverse depth) -> world point times w.

    x and y are pixels of arrays. For an orthographic camera the depth takes the place
    of its inverse.
    """
    (width, height), (left, top), p = camera.size, camera.window, camera.project
    screen = np.array(
        [
            [2 / width, 0, 2 * left / width - 1],
            [0, -2 / height, 1 - 2 * top / height],
            [0, 0, 1],
        ]
    )
    column = 3 if camera.orthographic else 2
    sign = 1.0 if camera.orthographic else -1.0
    axes = np.zeros((4, 4))
    for row in (0, 1):  # clip = p[r, r] X + p[r, column] * (1 or -Z)
        axes[row, :3] = (screen[row] - sign * p[row, column] * screen[2]) / p[row, row]
    if camera.orthographic:
        axes[2, 3], axes[3, 2] = -1.0, 1.0
    else:
        axes[2, 2], axes[3, 3] = -1.0, 1.0
    return np.asarray(np.linalg.inv(camera.view) @ axes)


def pixels_of(camera: Camera) -> Matrix:
    """Return (4, 4): world point -> (x w, y w, w, inverse depth w).

    x and y are pixels of arrays. For an orthographic camera the depth takes the place
    of its inverse.
    """
    (width, height), (left, top) = camera.size, camera.window
    screen = np.array(
        [
            [width / 2, 0, 0, width / 2 - left],
            [0, -height / 2, 0, height / 2 - top],
            [0, 0, 0, 1],
        ]
    )
    near = -camera.view[2] if camera.orthographic else np.array([0.0, 0.0, 0.0, 1.0])
    return np.vstack([screen @ camera.project @ camera.view, near])


def reprojection(here: Camera, there: Camera) -> Reprojection:
    """Return the reprojection of pixels from one camera to another.

    Parameters
    ----------
    here, there : Camera
        The camera of the pixels, and the one that they are reprojected to.

    Returns
    -------
    transform : (4, 4) float32 array or PanoramaReprojection
        The matrix takes (x, y, 1, inverse depth) here to (x w, y w, w, inverse depth w)
        there. Between panoramas the reprojection is not linear.
    """
    if here.sphere is not None and there.sphere is not None:
        return panorama_reprojection(here, there)
    return (pixels_of(there) @ world_of(here)).astype(np.float32)


def pair(
    here: Stored,
    there: Stored,
    object_motion: ObjectMotion | None = None,
    extent: tuple[Array, Array] | None = None,
) -> Pair:
    """Describe a frame and its neighbour for reprojection.

    Parameters
    ----------
    here : Stored
        The frame that samples are gathered for.
    there : Stored
        Its neighbour.
    object_motion : ObjectMotion, optional
        Where moving objects of `here` were in `there`.
    extent : tuple of (H W,) float32 arrays, optional
        `find_ranges` of `here`, for callers with many pairs. Computed by default.

    Returns
    -------
    pair : Pair
    """
    forth = reprojection(here.camera, there.camera)
    back = reprojection(there.camera, here.camera)
    if object_motion is not None and object_motion.is_empty:
        object_motion = None
    if object_motion is not None:
        object_motion = _add_edges(object_motion, here, there)
    extent = extent or find_ranges(here.inverse_depth, here.shape)
    return Pair(here, there, forth, back, extent, object_motion)


def _add_edges(
    object_motion: ObjectMotion, here: Stored, there: Stored
) -> ObjectMotion:
    """Return object motion that includes the edges of moving objects.

    Pixels on an edge belong to both sides: they move along with the nearer one.
    """
    own = np.zeros(here.inverse_depth.size, bool)
    own[object_motion.pixels] = True
    edges, leading = _find_edges(own, here)
    place = np.searchsorted(object_motion.pixels, leading)
    (row, column), (down, across) = (
        np.divmod(x, here.shape[1]) for x in (edges, leading)
    )
    x = object_motion.x[place] + (column - across).astype(np.float32)
    y = object_motion.y[place] + (row - down).astype(np.float32)
    pixels = np.concatenate((object_motion.pixels, edges))
    order = np.argsort(pixels, kind="stable")
    moving = object_motion.moving.copy()
    moving[_find_edges(moving, there)[0]] = True
    return ObjectMotion(
        pixels[order],
        np.concatenate((object_motion.x, x))[order],
        np.concatenate((object_motion.y, y))[order],
        moving,
    )


def _find_edges(
    mask: NDArray[np.bool_], frame: Stored
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pixels (n,) whose leading surface is in a mask (H W), and its pixels.

    Pixels of the mask itself are not among them.
    """
    height, width = frame.shape
    rims = np.flatnonzero((frame.rims > 0) & ~mask)
    row, column = np.divmod(rims, width)
    down, across = np.divmod(frame.rims[rims].astype(np.intp) - 1, 3)
    row = np.clip(row + down - 1, 0, height - 1)
    column = np.clip(column + across - 1, 0, width - 1)
    leading = row * width + column
    led = mask[leading]
    return rims[led], leading[led]


def spot_stride(shape: tuple[int, int]) -> int:
    """Return the pixels between spots, where some of a picture's are enough."""
    return _STRIDES[shape[0] * shape[1] >= _LARGE]


def spread(pixels: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """Return at most `most` of some pixels (n,), evenly spread."""
    # an odd step has no common factor with the width of many pictures
    return pixels[:: (-(-len(pixels) // most) | 1)]


def grid(shape: tuple[int, int], first: int = 0, last: int | None = None) -> Grid:
    """Return the centres of the pixels of rows `first` to `last` (excluded)."""
    height, width = shape
    last = height if last is None else last
    x = np.arange(width, dtype=np.float32) + np.float32(0.5)
    y = np.arange(first, last, dtype=np.float32) + np.float32(0.5)
    pixels = slice(first * width, last * width)
    return Grid(pixels, np.tile(x, last - first), np.repeat(y, width))


def reproject(
    reprojection: Reprojection, x: Array, y: Array, inverse_depth: Array
) -> tuple[Array, Array, Array]:
    """Reproject pixels from one frame to another.

    Parameters
    ----------
    reprojection : (4, 4) float32 array or PanoramaReprojection
        From `reprojection`.
    x, y : (n,) float32 array
        Positions here, in pixels.
    inverse_depth : (n,) float32 array
        Inverse depth here; the depth for an orthographic camera.

    Returns
    -------
    x, y, inverse_depth : (n,) float32 array
        The same there; NaN behind the camera.
    """
    if isinstance(reprojection, PanoramaReprojection):
        return reprojection.reproject(x, y, inverse_depth)
    across, down, w, near = (
        row[0] * x + row[1] * y + row[3] * inverse_depth + row[2]
        for row in reprojection
    )
    w[~(w > 0.0)] = np.nan
    return across / w, down / w, near / w


def nearest(x: Array, y: Array, shape: tuple[int, int]) -> Places:
    """Return the pixels that positions (n,) fall into; not seen outside the frame."""
    height, width = shape
    seen = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    x, y = np.where(seen, x, np.float32(0.5)), np.where(seen, y, np.float32(0.5))
    column, row = x.astype(np.int32), y.astype(np.int32)
    return Places(row * np.int32(width) + column, seen)


def centres(pixels: NDArray[np.integer], width: int) -> tuple[Array, Array]:
    """Return the centres (x, y) of flat pixels (n,)."""
    row, column = np.divmod(pixels.astype(np.int32), np.int32(width))
    return column + np.float32(0.5), row + np.float32(0.5)


def known(x: Array, y: Array, mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return positions, NaN outside `mask`."""
    nan = np.float32(np.nan)
    return np.where(mask, x, nan), np.where(mask, y, nan)


def reprojected_placeholder(
    number: int, camera: Camera, beside: Sequence[Stored]
) -> Stored:
    """Return a frame without samples that shows the geometry of the frames beside it.

    Of an orthographic camera the depth takes the place of its inverse, so the smallest
    value is the nearest.

    Parameters
    ----------
    number : int
        Frame number of the placeholder.
    camera : Camera
        Its camera.
    beside : sequence of Stored
        Frames beside it, whose size and passes it gets.

    Returns
    -------
    placeholder : Stored
        All pixels are invalid. `inverse_depth` is reprojected from `beside`, NaN where
        none of these frames shows what it shows.
    """
    first = beside[0]
    nearer = np.minimum if camera.orthographic else np.maximum
    near = np.full(first.inverse_depth.shape, np.inf if camera.orthographic else -1.0)
    for frame in beside:
        own = grid(frame.shape)
        transform = reprojection(frame.camera, camera)
        x, y, reprojected = reproject(transform, own.x, own.y, frame.inverse_depth)
        places = nearest(x, y, first.shape)
        is_seen = places.seen & np.isfinite(reprojected)
        nearer.at(near, places.pixel[is_seen], reprojected[is_seen])
    near[~np.isfinite(near) | (near < 0.0)] = np.nan
    # pixels stretch where the camera comes nearer: adjacent pixels fill the gaps
    around = extreme(near.reshape(first.shape).astype(np.float32), np.fmax).ravel()
    empty = np.ones(len(near), bool)
    return Stored(
        number=number,
        camera=camera,
        shape=first.shape,
        samples=first.samples,
        picture=np.zeros_like(first.picture),
        parts=dict.fromkeys(first.parts),
        inverse_depth=np.where(np.isnan(near), around, near).astype(np.float32),
        invalid=empty,
        noise=None if first.noise is None else first.noise.without(empty),
    )
