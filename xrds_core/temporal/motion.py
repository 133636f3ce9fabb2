"""Reprojection: where every pixel of one frame was in another one.

A pixel's centre and depth give a point in the world, which the other frame's camera
shows elsewhere. That is linear in (x, y, 1, inverse depth), so one 4x4 matrix for each
pair of frames describes it. Inverse depth is 1 / depth for a perspective camera, 0 for
the sky; for an orthographic camera the depth takes its place.

A reprojected position is valid if it survives the way back: what the other frame shows
there must come from this pixel, to within a pixel of motion, and be as near as
something in the 9x9 pixels around it. This rejects occlusions and disocclusions, and
leaves edges their mixed samples as long as both sides of the edge move alike. Selecting
samples by what is at the pixel's own centre would select by content: edges would lose
their antialiasing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .local_filters import extreme, extreme_at
from .panorama import PanoramaReprojection, panorama_reprojection

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Camera, Matrix, Stored

    Reprojection = Array | PanoramaReprojection

# Pixels by which forward and backward motion may differ; half as much for moving
# objects, whose edges are known less well.
_TOLERANCE = 1.0
MOVING_TOLERANCE = 0.5
# Their difference counts as this much distance from the true position (squared).
_AS_DISTANCE = 2.0
# Relative excess of inverse depth over the range around a pixel that is allowed.
_INVERSE_DEPTH_SLACK = 0.02
# Parallax between both sides of an edge counts as this much distance (squared), up to a
# pixel. Where all is fine edges, 0.5 cost 0.2 dB, and leaving such samples out 1 dB.
_AS_DISTANCE_AT_RIMS, _MOST_AT_RIMS = 0.3, 1.0
# Cycles' first sample lies at the pixel's centre. Frames of a sample or two that move
# by whole pixels would all show the same points, and lines thinner than a pixel would
# break up. So there the pixel taken is jittered by up to this much. Motion counts as
# whole pixels where a position is nearer to a centre than this, per frame between.
FEW_SAMPLES = 2.0
_OFF, _WHOLE = 0.6, 0.02
# Multiples of these spread evenly over a unit square (M. Roberts, R3 and R2 sequences);
# as fractions of 2^32, so that no rounding depends on the processor.
_SPREAD_X = np.array([3518319155, 2882110345, 2360945575], np.uint32)
_SPREAD_Y = np.array([3242174889, 2447445414, 2654435769], np.uint32)
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
    """Where pixels were in another frame.

    `pixel`: flat index of the other frame's nearest pixel, 0 where not seen; `x` and
    `y`: from the true position to that pixel's centre, in pixels; `apart`: the square
    of this distance, plus the differences of forward and backward motion and of both
    sides of an edge; `seen`: where the other frame shows the same. All (n,), in the
    order of the grid.
    """

    pixel: NDArray[np.int32]
    x: Array
    y: Array
    apart: Array
    seen: NDArray[np.bool_]

    def put(self, at: NDArray[np.intp] | slice, other: Places) -> None:
        """Replace those `at` some indices by others."""
        self.pixel[at], self.apart[at] = other.pixel, other.apart
        self.x[at], self.y[at], self.seen[at] = other.x, other.y, other.seen


@dataclass(frozen=True)
class ObjectMotion:
    """Where the moving objects of one frame were in another one.

    `pixels`: flat, ascending, those of this frame that show moving objects; `x` and
    `y`: where they were in the other frame, NaN where forward and backward motion are
    inconsistent. All (m,). `moving` (H W): which pixels of the other frame show moving
    objects, `beside` (H W), or None: which of this frame show something else, but may
    contain some of their light.
    """

    pixels: NDArray[np.intp]
    x: Array
    y: Array
    moving: NDArray[np.bool_]
    beside: NDArray[np.bool_] | None = None

    @property
    def is_empty(self) -> bool:
        """Whether neither frame shows anything that moves by itself."""
        return not len(self.pixels) and not self.moving.any()


@dataclass(frozen=True)
class Pair:
    """Two frames, and the reprojection of pixels from one to the other and back."""

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
        turn = _axes(here) @ turn @ _axes(there).T
        same = np.allclose(turn, np.eye(3), atol=1e-7)
        return None if same else turn.astype(np.float32)

    @property
    def jitters(self) -> bool:
        """Whether the pixels taken are jittered where places lie at pixel centres."""
        here, there = self.here, self.there
        is_static = here.camera.same(replace(there.camera, window=here.camera.window))
        moment = here.number == there.number
        return not (here.samples > FEW_SAMPLES or is_static or moment)

    @property
    def whole_motion(self) -> float:
        """The squared distance to a pixel's centre up to which a place lies there."""
        return (_WHOLE * abs(self.there.number - self.here.number)) ** 2


def _axes(camera: Camera) -> Matrix:
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
    """Return (4, 4): world point -> (x w, y w, w, inverse depth w), as `world_of`."""
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

    (4, 4): (x, y, 1, inverse depth) here -> (x w, y w, w, inverse depth w) there; of
    panoramas `PanoramaReprojection`.
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
    """Return what `places` needs to know of two frames.

    `extent` is `surroundings` of `here`, for callers with many pairs.
    """
    forth = reprojection(here.camera, there.camera)
    back = reprojection(there.camera, here.camera)
    if object_motion is not None and object_motion.is_empty:
        object_motion = None
    if object_motion is not None:
        object_motion = _with_rims(object_motion, here, there)
    return Pair(
        here, there, forth, back, extent or inverse_depth_range(here), object_motion
    )


def _with_rims(
    object_motion: ObjectMotion, here: Stored, there: Stored
) -> ObjectMotion:
    """Return object motion that includes the edges of moving objects.

    Pixels on an edge belong to both sides. They are not reused for the side that stands
    still: the moving object's share of such a pixel is different in every frame.
    """
    own = np.zeros(here.inverse_depth.shape, bool)
    own[object_motion.pixels] = True
    beside = _beside(own, here)
    moving = object_motion.moving | _beside(object_motion.moving, there)
    return replace(object_motion, moving=moving, beside=beside)


def _beside(mask: NDArray[np.bool_], frame: Stored) -> NDArray[np.bool_]:
    """Return the rims (H W) that are adjacent to a mask (H W), but not in it."""
    wide = extreme(mask.reshape(frame.shape), np.logical_or).ravel()
    return np.asarray(wide & ~mask & frame.rims)


def inverse_depth_range(frame: Stored) -> tuple[Array, Array]:
    """Return the range of inverse depth in the 9x9 pixels around, with some slack.

    Less than 9x9 cost 1.4 dB on a house with fine rails: for objects thinner than a
    pixel, hits and misses must not decide which samples are reused.
    """
    inverse_depth = frame.inverse_depth.reshape(frame.shape)
    least, most = (
        extreme(extreme(inverse_depth, smaller), smaller, step=3).ravel()
        for smaller in (np.fmin, np.fmax)
    )
    slack = np.float32(_INVERSE_DEPTH_SLACK)
    return least * (1 - slack), most * (1 + slack)


def spot_stride(shape: tuple[int, int]) -> int:
    """Return the pixels between spots, where some of a picture's are enough."""
    return _STRIDES[shape[0] * shape[1] >= _LARGE]


def spread(pixels: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """Return at most so many of some pixels (n,), evenly."""
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
    """Return (x, y, inverse depth) there of pixels (n,) here; NaN behind the camera."""
    if isinstance(reprojection, PanoramaReprojection):
        return reprojection.reproject(x, y, inverse_depth)
    across, down, w, near = (
        row[0] * x + row[1] * y + row[3] * inverse_depth + row[2]
        for row in reprojection
    )
    w[~(w > 0.0)] = np.nan
    return across / w, down / w, near / w


def places(pair: Pair, grid: Grid) -> Places:
    """Find where rows of pixels of `pair.here` were in `pair.there`."""
    found, _ = still_places(pair, grid)
    _penalise_rims(found, pair, grid)
    return (
        found if pair.object_motion is None else _with_object_motion(found, pair, grid)
    )


def still_places(pair: Pair, grid: Grid) -> tuple[Places, NDArray[np.bool_]]:
    """Find places as if only the camera moved, and which of them are in the frame."""
    near = pair.here.inverse_depth[grid.pixels]
    x, y, _ = reproject(pair.forth, grid.x, grid.y, near)
    found = nearest(x, y, pair.there.shape)
    _jitter(found, pair, grid, x, y)
    centre_x, centre_y = centres(found.pixel, pair.there.shape[1])
    near = pair.there.inverse_depth.take(found.pixel)
    back_x, back_y, near = reproject(pair.back, centre_x, centre_y, near)
    # the difference of forward and backward motion
    back_x += x - grid.x - centre_x
    back_y += y - grid.y - centre_y
    left = back_x**2 + back_y**2
    least, most = (part[grid.pixels] for part in pair.extent)
    seen = found.seen & (left < _TOLERANCE**2) & (near >= least) & (near <= most)
    left[~seen] = 0.0
    apart = found.apart + np.float32(_AS_DISTANCE) * left
    return replace(found, apart=apart, seen=seen), found.seen


def _jitter(found: Places, pair: Pair, grid: Grid, x: Array, y: Array) -> None:
    """Jitter the pixel taken where places (n,) lie at pixel centres."""
    there = pair.there
    if not pair.jitters:
        return
    at = np.flatnonzero(found.seen & (found.apart < pair.whole_motion))
    column, row = (x[at].astype(np.uint32) for x in (grid.x, grid.y))
    number = np.uint32(there.number % (1 << 32))
    off_x, off_y = (
        np.float32(2 * _OFF) * (_fraction(column, row, number, x) - np.float32(0.5))
        for x in (_SPREAD_X, _SPREAD_Y)
    )
    other = nearest(x[at] + off_x, y[at] + off_y, there.shape)
    at, inside = at[other.seen], other.seen
    found.pixel[at] = other.pixel[inside]
    found.x[at], found.y[at] = (other.x + off_x)[inside], (other.y + off_y)[inside]


def _fraction(
    column: NDArray[np.uint32],
    row: NDArray[np.uint32],
    number: np.uint32,
    spread: NDArray[np.uint32],
) -> Array:
    """Return numbers (n,) in [0, 1) that spread over pixels and frames."""
    with np.errstate(over="ignore"):  # the whole part goes
        mixed = column * spread[0] + row * spread[1] + number * spread[2]
    return (mixed >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _penalise_rims(found: Places, pair: Pair, grid: Grid) -> None:
    """Add distance to pixels with light of a nearer surface that moves differently.

    Pixels at an edge contain some samples of the nearer side. A nearer surface next to
    the pixel taken does not belong here; one next to this pixel is missing there.
    """
    assert isinstance(grid.pixels, slice)
    here, there = pair.here, pair.there
    apart = np.zeros(len(found.apart), np.float32)
    at = np.flatnonzero(found.seen & here.rims[grid.pixels])
    apart[at] = _parallax(pair.forth, here, at + grid.pixels.start)
    at = np.flatnonzero(found.seen & there.rims.take(found.pixel))
    apart[at] = np.fmax(apart[at], _parallax(pair.back, there, found.pixel[at]))
    np.fmin(apart, np.float32(_MOST_AT_RIMS), out=apart)  # NaN behind the camera
    found.apart[...] += np.float32(_AS_DISTANCE_AT_RIMS) * apart


def _parallax(
    transform: Reprojection, frame: Stored, pixels: NDArray[np.integer]
) -> Array:
    """Return the squared parallax of flat pixels to the nearest surface around them."""
    x, y = centres(pixels, frame.shape[1])
    own_x, own_y, _ = reproject(transform, x, y, frame.inverse_depth.take(pixels))
    nearest = extreme_at(frame.inverse_depth, pixels, frame.shape, frame.nearer)
    near_x, near_y, _ = reproject(transform, x, y, nearest)
    return (near_x - own_x) ** 2 + (near_y - own_y) ** 2


def _with_object_motion(found: Places, pair: Pair, grid: Grid) -> Places:
    """Return places with those of moving objects replaced by their own."""
    object_motion = pair.object_motion
    assert object_motion is not None
    assert isinstance(grid.pixels, slice)
    found.seen[...] &= ~object_motion.moving.take(found.pixel)
    if object_motion.beside is not None:
        found.seen[...] &= ~object_motion.beside[grid.pixels]
    part = slice(
        *object_motion.pixels.searchsorted((grid.pixels.start, grid.pixels.stop))
    )
    moved = nearest(object_motion.x[part], object_motion.y[part], pair.there.shape)
    inside = object_motion.pixels[part] - grid.pixels.start
    found.put(inside, moved)
    return found


def nearest(x: Array, y: Array, shape: tuple[int, int]) -> Places:
    """Return the pixels that positions (n,) fall into; not seen outside the frame."""
    height, width = shape
    seen = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    x, y = np.where(seen, x, np.float32(0.5)), np.where(seen, y, np.float32(0.5))
    column, row = x.astype(np.int32), y.astype(np.int32)
    off_x, off_y = column - x + np.float32(0.5), row - y + np.float32(0.5)
    pixel = row * np.int32(width) + column
    return Places(pixel, off_x, off_y, off_x**2 + off_y**2, seen)


def centres(pixels: NDArray[np.integer], width: int) -> tuple[Array, Array]:
    """Return the centres (x, y) of flat pixels (n,)."""
    row, column = np.divmod(pixels.astype(np.int32), np.int32(width))
    return column + np.float32(0.5), row + np.float32(0.5)


def known(x: Array, y: Array, mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return positions, NaN outside `mask`."""
    nan = np.float32(np.nan)
    return np.where(mask, x, nan), np.where(mask, y, nan)
