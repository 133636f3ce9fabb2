"""Finds frames that were rendered with one seed: their noise is equal, pixel by pixel.

Such samples add nothing new. Where the camera moves, reprojection lays them beside each
other, and a denoiser takes the streaks for texture. They are detected by residuals, of
which little is texture. Where pixels have moved, equal noise agrees at the same place
of the picture, and texture where the surface was. Where pixels have not moved, both
agree; but with equal noise the difference is far below the noise of each frame.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import floats
from .reprojection import centres, nearest, reproject, reprojection, spread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored

    Pixels = NDArray[np.integer]
    Mask = NDArray[np.bool_]


_SPOTS = 1 << 14  # pixels that are looked at, at most
_FEWEST = 256  # of them that say anything; fewer may agree by chance
_NOISE = 0.005  # relative to the pixels around: less is rounding
_AGREE = 0.25  # share of signs, of independent noise 0, of equal noise 1
_BEYOND = 0.15  # by which it exceeds that of texture
_EVEN = 0.02  # range of guides in 3x3 pixels of one surface, where all else is noise
# Of the difference to the residual, of independent noise the root of 2. Texture that
# the guides do not show lessens it, but a still picture rendered twice has none.
_SLOW, _STILL = 0.25, 0.05
_SMALL = 0.25  # quantile of residuals
# The Laplacian of a Laplacian: it keeps noise and leaves out slopes and edges.
# J. Immerkaer, Fast Noise Variance Estimation, 1996.
_MASK = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).astype(np.float32) / 6.0
_AROUND = tuple(product((-1, 0, 1), repeat=2))
_SEEN: WeakKeyDictionary[Stored, _Spots] = WeakKeyDictionary()


class IndependentFrames:
    """Leaves out neighbours whose noise a frame, or a nearer neighbour, has as well.

    One instance serves a whole shot, so that each pair of frames is compared once.

    Parameters
    ----------
    say : callable
        Takes one line of text, about the first such pair of the shot.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say: Callable[[str], object] | None = say
        self._equal: dict[tuple[int, int], bool] = {}

    def of(self, own: Stored, others: Sequence[Stored]) -> list[Stored]:
        """Return the neighbours with noise of their own.

        Frames far apart agree less, since they show other things: what each has in
        common with one between them tells that both are of one seed.

        Parameters
        ----------
        own : Stored
            The frame.
        others : sequence of Stored
            Its neighbours.

        Returns
        -------
        independent : list of Stored
            Those of `others`, in their order, that have other noise than the frame and
            than each other.
        """
        kinds: list[list[Stored]] = []
        for frame in (own, *others):
            same = [
                kind
                for kind in kinds
                if any(self._are_equal(frame, other) for other in kind)
            ]
            kinds = [kind for kind in kinds if kind not in same]
            kinds.append([*(frame for kind in same for frame in kind), frame])
        of_own = next(kind for kind in kinds if own in kind)
        nearest_ones = [kind[0] for kind in kinds if kind is not of_own]
        return [other for other in others if other in nearest_ones]

    def _are_equal(self, own: Stored, other: Stored) -> bool:
        first, last = sorted((own, other), key=lambda frame: frame.number)
        pair = first.number, last.number
        if pair[0] == pair[1]:  # views of one moment
            return False
        if pair not in self._equal:
            self._equal[pair] = have_equal_noise(first, last)
        if self._equal[pair] and self._say is not None:
            self._say(
                f"frames {pair[0]} and {pair[1]} hold the same noise, of which nothing "
                "can be reused: render each frame with a seed of its own (in Blender "
                "the clock beside the seed)"
            )
            self._say = None
        return self._equal[pair]


def have_equal_noise(frame: Stored, other: Stored) -> bool:
    """Whether two frames have the same noise, pixel by pixel.

    Parameters
    ----------
    frame, other : Stored
        Frames of one shot, the earlier one first.

    Returns
    -------
    bool
        False as well where too few pixels have noise to compare.
    """
    if frame.noise is None or other.noise is None or frame.shape != other.shape:
        return False
    first, second = _get_spots(frame), _get_spots(other)
    spots, residual, other_residual = first.pixels, first.residual, second.residual
    x, y = centres(spots, frame.shape[1])
    transform = reprojection(frame.camera, other.camera)
    places = nearest(
        *reproject(transform, x, y, frame.inverse_depth[spots])[:2], frame.shape
    )
    noisy = places.seen & (
        np.minimum(np.abs(residual), np.abs(other_residual)) > _NOISE
    )
    even = noisy & first.is_even
    moved = places.pixel != spots
    if (at := _first_sufficient(even & moved, noisy & moved)) is not None:
        beside = _find_residual(other, _keep_inside(places.pixel[at], frame.shape))
        return _agree(residual[at], other_residual[at], beside)
    if (at := _first_sufficient(even & ~moved)) is None:
        return False
    is_still = frame.camera.same(other.camera)
    return _differ_little(
        residual[at], other_residual[at], _STILL if is_still else _SLOW
    )


def _choose_spots(shape: tuple[int, int]) -> Pixels:
    """Return pixels (n,) that are spread over a picture, but for its edge."""
    height, width = shape
    rows, columns = np.arange(1, height - 1), np.arange(1, width - 1)
    return spread((rows[:, None] * width + columns).ravel(), _SPOTS)


def _keep_inside(pixels: Pixels, shape: tuple[int, int]) -> Pixels:
    """Return the nearest pixels that are not at the picture's edge."""
    height, width = shape
    row, column = np.divmod(pixels, width)
    return np.clip(row, 1, height - 2) * width + np.clip(column, 1, width - 2)


class _Spots:
    """What some pixels of a frame show; a frame is compared with many others."""

    def __init__(self, frame: Stored) -> None:
        self.pixels = _choose_spots(frame.shape)
        self.residual = _find_residual(frame, self.pixels)
        self.is_even = _is_even(frame, self.pixels)


def _get_spots(frame: Stored) -> _Spots:
    if frame not in _SEEN:
        _SEEN[frame] = _Spots(frame)
    return _SEEN[frame]


def _find_residual(frame: Stored, pixels: Pixels) -> Array:
    """Return the noise of brightness (n,), relative to that of 3x3 pixels."""
    assert frame.noise is not None
    width = frame.shape[1]
    around = [
        floats(frame.noise.brightness[pixels + i * width + j]) for i, j in _AROUND
    ]
    noise = np.tensordot(_MASK.ravel(), around, axes=1)
    return np.asarray(noise / np.maximum(np.mean(around, axis=0), np.float32(1e-6)))


def _is_even(frame: Stored, pixels: Pixels) -> Mask:
    """Return where all guides are alike in 3x3 pixels."""
    width = frame.shape[1]
    guides = slice(3, 9)
    around = [floats(frame.picture[pixels + i * width + j, guides]) for i, j in _AROUND]
    return np.asarray((np.ptp(around, axis=0) < _EVEN).all(axis=-1))


def _first_sufficient(*places: Mask) -> Mask | None:
    """Return the first mask with enough places; None if none has."""
    return next((x for x in places if x.sum() >= _FEWEST), None)


def _agree(own: Array, other: Array, beside: Array) -> bool:
    """Whether residuals agree at one place of the picture, more than on a surface."""
    same, texture = (
        float(np.mean(np.sign(own) * np.sign(residual))) for residual in (other, beside)
    )
    least = max(_AGREE, 5.0 / len(own) ** 0.5)
    return same > max(least, texture + _BEYOND)


def _differ_little(own: Array, other: Array, most: float) -> bool:
    """Whether residuals differ by little of what they are, where they are small.

    Where they are large there may be texture.
    """
    residual = (np.abs(own) + np.abs(other)) / 2
    small = residual <= np.quantile(residual, _SMALL)
    difference = np.median(np.abs(own - other)[small])
    return bool(difference < most * np.median(residual[small]))
