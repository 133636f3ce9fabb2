"""Finds depths that are none along the camera's axis, or in another unit than cameras.

No file says it, but other passes show it. A step from pixel to pixel on one surface
leads across its normal; and what two frames show lies where the way of the camera puts
it, so that of all units one lays their albedo on each other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..accumulation.reprojection import (
    centres,
    nearest,
    reproject,
    reprojection,
    spread,
    world_of,
)
from ..arrays import floats

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..accumulation.frame import Stored
    from ..arrays import Array

    Pixels = NDArray[np.integer]


_SPOTS = 2048  # pixels that are looked at, at most
_FEWEST = 64  # of them that say anything
_FRAMES = 8  # that are looked at: a camera may rest at first
_SMOOTH = 0.999  # cosine of two normals on one surface
_NEAR = 0.1  # relative difference of their depths
_ACROSS = 0.02  # sine of the angle by which steps leave a surface, where all is right
_FAR_ACROSS = 0.05  # where something is wrong, whatever it is
_STEEPER = 0.3  # share of it that the right kind leaves
_DIFFERS = 0.02  # mean difference of albedo of two frames, where all is right
_BESIDE = 0.5  # share of it that the right unit leaves; some is noise
_MOST = 0.2  # difference of albedo that counts
_FACTORS = 10.0 ** (np.arange(-96, 97) / 24)  # of units: from 1/10000 to 10000

_NO_FIT = (
    "does not fit the normals: it may be scaled between near and far, or they may be "
    "in another space (--normal-space)"
)


class DepthKind:
    """Looks at the frames of a shot, as long as nothing is known of their depth.

    Parameters
    ----------
    say : callable
        Takes one line of text about a depth that is of another kind.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._left = _FRAMES

    def look(self, own: Stored, others: Sequence[Stored]) -> None:
        """Look at a frame and its neighbours."""
        camera = own.camera
        if not self._left or camera.sphere is not None or camera.orthographic:
            return
        self._left -= 1
        with np.errstate(all="ignore"):  # depths may be anything
            mismatch = kind_of(own) or (others and unit_of(own, others[-1]))
        if mismatch:
            self._left = 0
            self._say(
                f"the depth of frame {own.number} {mismatch}; as it is, few "
                "samples of neighbours are reused: convert it, or render Position"
            )


def kind_of(frame: Stored) -> str:
    """Say how a depth differs from one along the camera's axis, by its normals.

    Parameters
    ----------
    frame : Stored
        A frame with a perspective camera.

    Returns
    -------
    mismatch : str
        A phrase; "" if the depth fits or nothing can be said.
    """
    pairs = _find_surface_pairs(frame)
    if pairs.shape[1] < _FEWEST:
        return ""
    x, y = centres(pairs, frame.shape[1])
    near = frame.inverse_depth[pairs]
    length = np.linalg.norm(_find_points(frame, x, y, np.ones_like(x)), axis=0)
    kinds = {
        "": near,
        "fits the normals as length of the ray, not along the axis": near * length,
        "fits the normals as 1 / depth": 1.0 / near,
    }
    normal = floats(frame.picture[pairs][..., frame.normals]).mean(axis=0)
    left: dict[str, float] = {}
    for kind, inverse in kinds.items():
        first, second = np.moveaxis(_find_points(frame, x, y, inverse), 1, 0)
        step = second - first
        across = np.abs((step * normal.T).sum(axis=0))
        left[kind] = float(np.median(across / np.linalg.norm(step, axis=0)))
    best = min(left, key=lambda kind: left[kind])
    if left[""] > max(_ACROSS, left[best] / _STEEPER):
        return best
    return _NO_FIT if left[""] > _FAR_ACROSS else ""


def unit_of(frame: Stored, other: Stored) -> str:
    """Say by which factor depths have to be multiplied to fit the cameras.

    Parameters
    ----------
    frame, other : Stored
        Two frames of a shot.

    Returns
    -------
    mismatch : str
        A phrase; "" if the depth fits or nothing can be said.
    """
    if frame.shape != other.shape:
        return ""
    spots = spread(np.flatnonzero(frame.inverse_depth > 0.0), _SPOTS)
    if len(spots) < _FEWEST:
        return ""
    x, y = centres(spots, frame.shape[1])
    transform = reprojection(frame.camera, other.camera)
    albedo = slice(frame.normals.start - 3, frame.normals.start)
    own, beside = floats(frame.picture[spots, albedo]), other.picture[:, albedo]

    def misfit(factor: float) -> float:
        inverse = frame.inverse_depth[spots] / np.float32(factor)
        places = nearest(*reproject(transform, x, y, inverse)[:2], frame.shape)
        apart = np.abs(own - floats(beside[places.pixel])).mean(axis=-1)
        return float(np.where(places.seen, np.minimum(apart, _MOST), _MOST).mean())

    as_it_is = misfit(1.0)
    if as_it_is < _DIFFERS:
        return ""
    left = np.array([misfit(factor) for factor in _FACTORS])
    # what moves with the camera fits an infinite depth
    if left.min() > _BESIDE * min(as_it_is, misfit(np.inf)):
        return ""
    factor = float(f"{_FACTORS[left.argmin()]:.2g}")
    return f"fits the cameras when multiplied by about {factor:g}"


def _find_points(frame: Stored, x: Array, y: Array, inverse_depth: Array) -> Array:
    """Return (3, ...) in the camera's axes, Z away from the viewer, of pixels."""
    world = np.tensordot(
        frame.camera.view @ world_of(frame.camera),
        np.stack((x, y, np.ones_like(x), inverse_depth)),
        axes=1,
    )
    points = world[:3] / world[3]
    points[2] *= -1.0
    return np.asarray(points)


def _find_surface_pairs(frame: Stored) -> Pixels:
    """Return pairs (2, n) of pixels, beside and below, that lie on one surface."""
    height, width = frame.shape
    inner = np.arange(height * width).reshape(height, width)[:-1, :-1]
    pixels = spread(inner.ravel(), 8 * _SPOTS)
    pairs = np.stack((pixels, pixels + width + 1))
    first_depth, second_depth = frame.inverse_depth[pairs]
    close = (
        np.abs(first_depth - second_depth)
        < _NEAR * np.minimum(first_depth, second_depth)
    ) & (first_depth > 0.0)
    first, second = floats(frame.picture[pairs][..., frame.normals])
    smooth = (first * second).sum(axis=-1) > _SMOOTH
    return pairs[:, spread(np.flatnonzero(close & smooth), _SPOTS)]
