"""Virtual images: where what mirrors and glass show was in other frames.

A plane mirror shows things at the depth of their virtual image behind it, a pane what
is beyond it; a curved mirror shows them somewhere between its surface and the length of
the path. And a virtual image may move by itself: in curved mirrors and thick glass, or
with what it shows. For a lattice of spots each candidate is reprojected into all
neighbours, and the one whose guides match best is taken: a plane sweep [1]_.

References
----------
.. [1] Collins, R. T. (1996). A space-sweep approach to true multi-image matching.
   IEEE Conference on Computer Vision and Pattern Recognition.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import floats
from .local_filters import box
from .noise import guides_of
from .reprojection import Grid, centres, nearest, reproject, spot_stride

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Stored
    from .reprojection import Pair

    Apply = Callable[[Callable[[Pair], Array], Sequence[Pair]], Iterable[Array]]


# Depths, from the surface (0) to the length of the path (1), which is a little too
# short or too long, as its parts are weighted by what the mirror reflects.
_SHARES = (0.06, 0.12, 0.25, 0.5, 0.75, 0.9, 1.0, 1.1)
# Pixels per frame of a virtual image's own motion, from coarse to fine.
_STEPS = (1.0, 0.5, 0.25)
_AREA = 5  # spots across, over which guides are compared
# A virtual image is used where it matches better than the surface by this factor, and
# by so many standard errors of the difference, over the spots: one on the path, and one
# that moves by itself, of which there are so many that one always matches by chance.
_BETTER, _SURE, _SURE_IF_MOVED = 0.85, 2.0, 3.0
_SEEN = 0.5  # of a candidate's spots, in neighbours
_TINY = np.float32(1e-9)


@dataclass(frozen=True)
class Images:
    """The virtual images that the pixels of a frame show.

    Attributes
    ----------
    frame : Stored
        The frame.
    stride : int
        Distance between the spots of the lattice, in pixels.
    lattice : (h, w, 3) float32 array
        For each spot where the virtual image lies, from the surface (0) to the end of
        the path (1), NaN for a surface; then its own motion, x and y in pixels per
        frame.
    """

    frame: Stored
    stride: int
    lattice: Array

    @cached_property
    def _shown(self) -> tuple[Grid, Array, Array]:
        """Pixels with a virtual image, its inverse depth (n,) and motion (n, 2)."""
        assert self.frame.image is not None
        pixels = np.flatnonzero(~np.isnan(self.frame.image))
        row, column = np.divmod(pixels, self.frame.shape[1])
        images = self.lattice[row // self.stride, column // self.stride]
        shows = ~np.isnan(images[:, 0])
        pixels, images = pixels[shows], images[shows]
        spots = Grid(pixels, *centres(pixels, self.frame.shape[1]))
        return spots, _interpolate_depth(self.frame, spots, images[:, 0]), images[:, 1:]

    def positions(self, pair: Pair) -> tuple[NDArray[np.intp], Array, Array]:
        """Return where the virtual images were in another frame.

        Parameters
        ----------
        pair : Pair
            The frame and the other one.

        Returns
        -------
        pixels : (n,) int array
            Pixels that show a virtual image, flat and ascending.
        x, y : (n,) float32 array
            Where it was in the other frame, in pixels.
        """
        spots, depth, motion = self._shown
        assert not isinstance(spots.pixels, slice)
        return spots.pixels, *_find_positions(pair, spots, depth, motion)


def reach(shape: tuple[int, int]) -> int:
    """Return the pixels on each side of a pixel that influence its virtual image."""
    return spot_stride(shape) * (_AREA // 2 + 2)


def find_images(
    target: Stored, pairs: Sequence[Pair], apply: Apply = map
) -> Images | None:
    """Find the virtual images that a frame shows.

    Parameters
    ----------
    target : Stored
        The frame.
    pairs : sequence of Pair
        The frame and each of its neighbours.
    apply : callable
        `map`, or a function like it that runs in threads.

    Returns
    -------
    images : Images or None
        None where the frame shows no virtual image.
    """
    if target.image is None or not pairs:
        return None
    stride = spot_stride(target.shape)
    lattice = _Sweep(target, pairs, stride, apply).images()
    return None if np.isnan(lattice[..., 0]).all() else Images(target, stride, lattice)


class _Sweep:
    """Tries candidates at the spots of a lattice, and keeps the best of each."""

    def __init__(
        self, target: Stored, pairs: Sequence[Pair], stride: int, apply: Apply
    ) -> None:
        assert target.image is not None
        self._target, self._pairs, self._each = target, pairs, apply
        height, width = target.shape
        half = stride // 2
        self._shape = -(-height // stride), -(-width // stride)
        rows = np.minimum(np.arange(self._shape[0]) * stride + half, height - 1)
        columns = np.minimum(np.arange(self._shape[1]) * stride + half, width - 1)
        pixels = (rows[:, None] * width + columns).ravel()
        shows = ~np.isnan(target.image[pixels])
        if target.invalid is not None:
            shows &= ~target.invalid[pixels]
        self._at = np.flatnonzero(shows)
        pixels = pixels[self._at]
        self._spots = Grid(pixels, *centres(pixels, width))
        self._own = _read_guides(target, pixels)
        all_seen = np.full(len(pixels), len(pairs), np.float32)
        self._enough = np.float32(_SEEN) * self._mean_around(all_seen)
        self._surface = np.zeros((len(pixels), 3), np.float32)
        self._cost_of_surface, self._error_of_surface = self._find_cost(self._surface)

    def images(self) -> Array:
        """Return `Images.lattice`."""
        limit = self._cost_of_surface * np.float32(_BETTER)
        images = _Best(self._surface, limit)
        for share in _SHARES:
            self._try_candidates(images, self._surface, (share, 0.0, 0.0), _SURE)
        for step in _STEPS:
            centre = images.candidates.copy()
            for x, y in product((-step, 0.0, step), repeat=2):
                if x or y:
                    self._try_candidates(images, centre, (0.0, x, y), _SURE_IF_MOVED)
        lattice = np.full((self._shape[0] * self._shape[1], 3), np.nan, np.float32)
        is_better = images.cost < limit
        lattice[self._at[is_better]] = images.candidates[is_better]
        return _fill_lattice(lattice.reshape(*self._shape, 3))

    def _try_candidates(
        self, images: _Best, start: Array, further: tuple[float, ...], sure: float
    ) -> None:
        candidates = start + np.array(further, np.float32)
        cost, error = self._find_cost(candidates)
        images.offer(candidates, np.where(self._is_sure(error, sure), cost, np.inf))

    def _is_sure(self, error: Array, sure: float) -> NDArray[np.bool_]:
        """Whether errors (n,) are less than the surface's by `sure` standard errors."""
        less = self._error_of_surface - error
        mean, square = self._mean_around(less), self._mean_around(np.square(less))
        # of all spots, those outside included: they differ by 0
        chance = np.maximum(square - np.square(mean), 0.0) / _AREA**2
        return np.asarray(mean > np.float32(sure) * np.sqrt(chance))

    def _find_cost(self, candidate: Array) -> tuple[Array, Array]:
        """Return squared differences of guides (n,): around each spot, and at it.

        The former are infinite where too little is seen.
        """
        depth = _interpolate_depth(self._target, self._spots, candidate[:, 0])

        def compare(pair: Pair) -> Array:
            positions = _find_positions(pair, self._spots, depth, candidate[:, 1:])
            places = nearest(*positions, pair.there.shape)
            apart = _read_guides(pair.there, places.pixel, pair.turn) - self._own
            seen = places.seen.astype(np.float32)
            if pair.there.invalid is not None:
                seen[pair.there.invalid.take(places.pixel)] = 0.0
            return np.stack([np.einsum("ij,ij->i", apart, apart) * seen, seen])

        error, seen = np.sum(list(self._each(compare, self._pairs)), axis=0)
        around, known = self._mean_around(error), self._mean_around(seen)
        around /= np.maximum(known, _TINY)
        around[known < self._enough] = np.inf
        return around, error / np.maximum(seen, np.float32(1.0))

    def _mean_around(self, values: Array) -> Array:
        """Return the mean over the spots around each (n,), 0 outside."""
        plane = np.zeros(self._shape[0] * self._shape[1], np.float32)
        plane[self._at] = values
        return box(plane.reshape(self._shape), _AREA).ravel()[self._at]


class _Best:
    """The best candidates (n, 3) so far, and their cost (n,)."""

    def __init__(self, candidates: Array, cost: Array) -> None:
        self.candidates, self.cost = candidates.copy(), cost.copy()

    def offer(self, candidates: Array, cost: Array) -> None:
        """Take those that cost less."""
        better = cost < self.cost
        self.candidates[better] = candidates[better]
        self.cost[better] = cost[better]


def _fill_lattice(lattice: Array) -> Array:
    """Return a lattice whose holes are filled from the spots beside them.

    Spots at the edge of a mirror may lie just outside of it.
    """
    wide = np.pad(lattice, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    result = lattice.copy()
    for beside in (wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1]):
        hole = np.isnan(result[..., 0])
        result[hole] = beside[hole]
    return result


def _find_positions(
    pair: Pair, spots: Grid, depth: Array, motion: Array
) -> tuple[Array, Array]:
    x, y, _ = reproject(pair.forth, spots.x, spots.y, depth)
    frames = np.float32(pair.there.number - pair.here.number)
    return x + motion[:, 0] * frames, y + motion[:, 1] * frames


def _interpolate_depth(frame: Stored, spots: Grid, share: Array) -> Array:
    """Return inverse depths between surface (0) and the end of the path (1)."""
    assert frame.image is not None
    near, far = frame.inverse_depth[spots.pixels], frame.image[spots.pixels]
    if frame.camera.orthographic:
        return np.asarray(near + share * (far - near))
    # a ratio first: the product of two inverse depths may be beyond float32
    return np.asarray(near * (far / (far + share * (near - far))))


def _read_guides(
    frame: Stored, pixels: NDArray[np.integer], turn: Array | None = None
) -> Array:
    # a slice of the picture would be copied whole before anything is taken of it
    guides = floats(frame.picture.take(pixels, axis=0))
    if turn is not None:
        guides[:, frame.normals] = guides[:, frame.normals] @ turn.T
    return guides_of(guides[:, frame.normals.start - 3 : frame.normals.stop])
