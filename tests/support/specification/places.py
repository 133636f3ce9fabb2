"""Where pixels of one frame were in another one, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.specification.filters import Array, extreme
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.reprojection import Grid, Pair, centres, grid, reproject
from xrds_core.accumulation.virtual_images import Images

Shape = tuple[int, int]

TOLERANCE, AS_DISTANCE = 1.0, 2.0  # of forward and backward motion
SURFACE = 0.02  # relative difference in inverse depth on one surface
SLACK = 0.02  # of the range of inverse depth
# Of the squared parallax at edges, in the logarithm of weights; its most.
AT_RIMS, AT_RIMS_OF_FEW, MOST_AT_RIMS = 1.7, 0.5, 1.0
OFF = 0.6  # pixels, of jitter
SPREAD_X = np.array([3518319155, 2882110345, 2360945575], np.uint32)
SPREAD_Y = np.array([3242174889, 2447445414, 2654435769], np.uint32)


@dataclass
class Places:
    """`pixel` (n,) taken, `x` and `y` from the position to its centre, how far `apart`
    that is, squared, with all that is unsure, and where it is `seen`.
    """

    pixel: Array
    x: Array
    y: Array
    apart: Array
    seen: Array

    def put(self, at: Array, other: Places) -> None:
        for name in ("pixel", "x", "y", "apart", "seen"):
            getattr(self, name)[at] = getattr(other, name)


def nearest(x: Array, y: Array, shape: Shape) -> Places:
    """The pixels that positions (n,) fall into; not seen outside the frame."""
    height, width = shape
    seen = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    x, y = np.where(seen, x, np.float32(0.5)), np.where(seen, y, np.float32(0.5))
    column, row = x.astype(np.int32), y.astype(np.int32)
    off_x, off_y = column - x + np.float32(0.5), row - y + np.float32(0.5)
    pixel = row * np.int32(width) + column
    return Places(pixel, off_x, off_y, off_x**2 + off_y**2, seen)


def ranges(frame: Stored) -> tuple[Array, Array]:
    """The range of inverse depth in the 9x9 pixels around, with some slack."""
    depth = frame.inverse_depth.reshape(frame.shape)
    least, most = (extreme(depth, f, 4).ravel() for f in (np.fmin, np.fmax))
    return least * np.float32(1 - SLACK), most * np.float32(1 + SLACK)


def nearest_surface(frame: Stored) -> Array:
    """Of the 3x3 pixels around each one (H W)."""
    nearer = np.fmin if frame.camera.orthographic else np.fmax
    return extreme(frame.inverse_depth.reshape(frame.shape), nearer, 1).ravel()


def rims(frame: Stored) -> Array:
    """Pixels (H W) next to a nearer surface."""
    apart = np.abs(nearest_surface(frame) - frame.inverse_depth)
    return apart > SURFACE * np.abs(frame.inverse_depth)


def still_places(pair: Pair) -> tuple[Places, Array]:
    """Places as if only the camera moved, and whether they are in the frame at all."""
    own = grid(pair.here.shape)
    depth = [
        nearest_depth(f) if pair.leads else f.inverse_depth
        for f in (pair.here, pair.there)
    ]
    x, y, _ = reproject(pair.forth, own.x, own.y, depth[0])
    found = nearest(x, y, pair.there.shape)
    in_frame = found.seen
    if pair.jitters:
        _jitter(found, pair, own, x, y)
    centre_x, centre_y = centres(found.pixel, pair.there.shape[1])
    near = depth[1][found.pixel]
    back_x, back_y, near = reproject(pair.back, centre_x, centre_y, near)
    left = (back_x + x - own.x - centre_x) ** 2 + (back_y + y - own.y - centre_y) ** 2
    least, most = ranges(pair.here)
    seen = in_frame & (left < TOLERANCE**2) & (near >= least) & (near <= most)
    apart = found.apart + np.float32(AS_DISTANCE) * np.where(seen, left, 0)
    return Places(found.pixel, found.x, found.y, apart, seen), in_frame


def _jitter(found: Places, pair: Pair, own: Grid, x: Array, y: Array) -> None:
    """Jitter the pixel taken where places lie at pixel centres."""
    at = np.flatnonzero(found.seen & (found.apart < pair.whole_motion))
    column, row = (each[at].astype(np.uint32) for each in (own.x, own.y))
    number = np.uint32(pair.there.number % (1 << 32))
    with np.errstate(over="ignore"):
        mixed = [
            column * each[0] + row * each[1] + number * each[2]
            for each in (SPREAD_X, SPREAD_Y)
        ]
    share = [(each >> np.uint32(8)) * np.float32(2.0**-24) for each in mixed]
    off = [np.float32(2 * OFF) * (each - np.float32(0.5)) for each in share]
    other = nearest(x[at] + off[0], y[at] + off[1], pair.there.shape)
    at, inside = at[other.seen], other.seen
    found.pixel[at] = other.pixel[inside]
    found.x[at], found.y[at] = (other.x + off[0])[inside], (other.y + off[1])[inside]


def nearest_depth(frame: Stored) -> Array:
    """Inverse depth (H W), at rims that of the nearest surface around."""
    return np.where(rims(frame), nearest_surface(frame), frame.inverse_depth)


def _parallax(transform: Any, frame: Stored, pixels: Array) -> Array:
    """The squared parallax between both sides of the edge in pixels (n,)."""
    x, y = centres(pixels, frame.shape[1])
    own = reproject(transform, x, y, frame.inverse_depth[pixels])
    near = reproject(transform, x, y, nearest_depth(frame)[pixels])
    apart = (near[0] - own[0]) ** 2 + (near[1] - own[1]) ** 2
    return np.where(rims(frame)[pixels], np.fmin(apart, MOST_AT_RIMS), 0.0)


def places(pair: Pair, images: Images | None = None, fall: float = -1.0) -> Places:
    """Places of all pixels: of surfaces, of what moves by itself, and of images."""
    found, _ = still_places(pair)
    here = np.arange(len(found.pixel))
    parallax = np.fmax(
        _parallax(pair.forth, pair.here, here),
        _parallax(pair.back, pair.there, found.pixel),
    )
    at_rims = (AT_RIMS if pair.leads else AT_RIMS_OF_FEW) / -fall
    found.apart += np.where(found.seen, np.float32(at_rims) * parallax, 0)
    motion = pair.object_motion
    if motion is not None:
        found.seen &= ~motion.moving[found.pixel]
        found.put(motion.pixels, nearest(motion.x, motion.y, pair.there.shape))
    if images is not None:
        pixels, x, y = images.positions(pair)
        found.put(pixels, nearest(x, y, pair.there.shape))
    return found
