"""Weights and sums the samples of neighbours, in the compiled library.

The steps, for each pixel of each neighbour: where it was, what it weighs there, the
offset of the nearest pixel; then for all neighbours together the similarity weight, and
light that changes. The sources lie in `native`.

Similarity: the neighbours' mean L and the frame's own mean m differ by the error of L
and by the noise of m. `noise` estimates how much of (m - L) squared is noise; the rest,
averaged over a few pixels, is the squared error E of L, whatever its cause: no list of
what may move or change is needed. Against V, the variance of the frame's own light,
V / (V + E) minimises the squared error. E is multiplied by a penalty, since a denoiser
removes most of V and nothing of E. Guides have little noise and show errors at once.
Light that changes where guides do not, such as a moving shadow, is hidden by the
frame's own noise; there the neighbours are compared with each other.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import floats
from ..native import structures
from ..native.library import Arrays, bands, in_threads, library
from .noise import guides_of
from .reprojection import PanoramaReprojection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from ..native.library import Arrays
    from .frame import Stored
    from .reprojection import Pair, Reprojection
    from .virtual_images import Images

    Mask = NDArray[np.bool_]
    Guess = NDArray[np.float16]


# Penalties: factors on errors seen in guides, and on light that changes, against the
# noise of light. They are divided by the frame's samples per pixel, since a denoiser
# removes less noise the more samples there are, down to a least one: that of guides is
# high, as errors of many neighbours add up where waves or glass show something else.
_GUIDES, _LEAST_GUIDES = 512.0, 32.0

_CHANGES, _LEAST_CHANGES = 256.0, 4.0

# (samples per pixel up to, pixels across): over how many pixels errors of guides are
# averaged. Half buffers of few samples say little about one pixel.
_GUIDE_AREAS = ((4.0, 9), (np.inf, 5))
# Squared, summed over the channels: below this albedo the ratio of light to albedo is
# taken from the whole frame.
_DARKEST_ALBEDO = 0.02
MARGIN = 12
"""Pixels on each side of a pixel that influence its weight."""


def light_for_albedo(frame: Stored) -> float:
    """Return the squared error of light's square root per squared error of albedo.

    A relative error of albedo is the same relative error of light, and half as much of
    its square root. The result is the mean over a frame.
    """
    assert frame.noise is not None
    light = float(floats(frame.noise.brightness[::7]).mean(dtype=np.float64)) ** 2 / 4
    albedo = guides_of(floats(frame.picture[::7, 3:]))[:, :3]
    squares = float(np.square(albedo).sum(axis=-1).mean(dtype=np.float64))
    return light / (squares + _DARKEST_ALBEDO)


def penalties(samples: float) -> tuple[np.float32, np.float32]:
    """Return the penalties of errors seen in guides, and of light that changes."""
    guides = max(_GUIDES / samples, _LEAST_GUIDES)
    changes = max(_CHANGES / samples, _LEAST_CHANGES)
    return np.float32(guides), np.float32(changes)


def guide_area(samples: float) -> int:
    """Return over how many pixels across errors of guides are averaged."""
    return next(area for most, area in _GUIDE_AREAS if samples <= most)


def for_library(
    transform: Reprojection, shape: tuple[int, int], arrays: Arrays
) -> structures.Reprojection:
    """Convert a reprojection to the structure that the library reads.

    Parameters
    ----------
    transform : (4, 4) float32 array or PanoramaReprojection
        The reprojection.
    shape : tuple of int
        Height and width of the frame whose pixels are reprojected.
    arrays : Arrays
        Keeps what the structure points to.

    Returns
    -------
    structure : structures.Reprojection
    """
    result = structures.Reprojection()
    if not isinstance(transform, PanoramaReprojection):
        result.matrix[:] = transform.ravel().tolist()
        return result
    result.matrix[:] = transform.turn.astype(np.float32).ravel().tolist()
    columns, rows = transform.directions(shape)
    result.columns = arrays.at(columns, np.float32, columns.size)
    result.rows = arrays.at(rows, np.float32, rows.size)
    result.left, result.top = transform.first
    result.across, result.down = transform.density
    result.window_x, result.window_y = transform.there.window
    return result


TILE = 64
"""Pixels across, of coarse rejection: as the library has it."""
# The squared parallax between both sides of an edge lowers the logarithm of a weight by
# so much of it, however many samples there are: the other side's light and texture are
# not this pixel's. Of few samples noise counts more. 1.2 and 2.5 were within 0.1 dB.
_AT_RIMS, _AT_RIMS_OF_FEW = 1.7, 0.5
_COLUMNS = 512  # of an area: what it needs beside the pictures stays small


@dataclass(frozen=True)
class Aligned:
    """A neighbour that shows the same in every pixel: no reprojection is needed."""

    other: Stored
    pair = None


@dataclass(frozen=True)
class Reprojected:
    """A neighbour whose pixels are found by reprojection and weighted.

    Attributes
    ----------
    pair : Pair
        The frame and the neighbour.
    tiles : (rows, columns) float32 array
        Weights of the tiles, from coarse rejection.
    fall : float
        The logarithm of a weight by distance is `fall` times the squared distance in
        pixels.
    """

    pair: Pair
    tiles: Array
    fall: float

    @property
    def other(self) -> Stored:
        """The neighbour frame."""
        return self.pair.there

    @property
    def is_reused(self) -> bool:
        """Whether any of its tiles is."""
        return bool(self.tiles.any())


@dataclass(frozen=True)
class Means:
    """Means over a frame's own and the reused samples.

    Attributes
    ----------
    passes : list of (H, W, C) float32 array
        Passes of the picture.
    parts : list of (H, W, 3) float32 array
        AOVs and light passes that have light in any frame.
    samples : (H, W) float32 array
        Samples per pixel that the means are taken over.
    reused : float
        How many samples of neighbours were reused in all.
    """

    passes: list[Array]
    parts: list[Array]
    samples: Array
    reused: float


@dataclass(frozen=True)
class Work:
    """Computes the means over the samples of one frame and of any of its neighbours.

    Attributes
    ----------
    target : Stored
        The frame that samples are gathered for.
    images : Images or None
        Virtual images that the frame shows.
    usual : float
        `light_for_albedo` of the frame.
    lit : tuple of str
        Names of the AOVs and light passes that have light in any frame.
    threads : int or None
        Number of threads; None for one for each processor.
    """

    target: Stored
    images: Images | None
    usual: float
    lit: tuple[str, ...]
    threads: int | None

    def guess(self, neighbours: Sequence[Aligned | Reprojected]) -> Guess:
        """Guess the picture from the samples of some neighbours.

        Parameters
        ----------
        neighbours : sequence of Aligned or Reprojected
            The neighbours.

        Returns
        -------
        guess : (n, H, W) float16 array
            Planes of the picture's passes and parts, and of brightness.
        """
        planes = self.target.picture.shape[1] + 3 * len(self.lit) + 1
        guess = np.empty((planes, *self.target.shape), np.float16)
        call = _Call(self, [(neighbour, 0) for neighbour in neighbours])
        call.target.guess_out = guess.ctypes.data
        call.run()
        return guess

    def means(
        self,
        groups: Sequence[Sequence[Aligned | Reprojected]],
        guess: Guess | None = None,
    ) -> Means:
        """Compute the means over the samples of a frame and its neighbours.

        Parameters
        ----------
        groups : sequence of sequences of Aligned or Reprojected
            Two groups of neighbours, which are judged apart.
        guess : (n, H, W) float16 array, optional
            From `guess`. With it the offsets of the pixels taken are taken out.

        Returns
        -------
        means : Means
        """
        (height, width), channels = self.target.shape, self.target.picture.shape[1]
        means = np.empty((channels, height * width), np.float32)
        parts = np.empty((3 * len(self.lit), height * width), np.float32)
        samples = np.empty((height, width), np.float32)
        call = _Call(
            self,
            [(neighbour, n) for n, group in enumerate(groups) for neighbour in group],
        )
        if guess is not None:
            call.target.guess = guess.ctypes.data
        call.target.means, call.target.part_means = means.ctypes.data, parts.ctypes.data
        call.target.samples = samples.ctypes.data
        reused = call.run()

        def pictures(planes: Array) -> list[Array]:
            return [
                planes[first : first + 3].reshape(height, width, -1)
                for first in range(0, len(planes), 3)
            ]

        return Means(pictures(means), pictures(parts), samples, reused)


@dataclass(frozen=True)
class Spots:
    """Where every `step`th pixel of a frame was, as if only the camera moved.

    In both directions the first one is pixel `step` // 2.

    Attributes
    ----------
    pixel : (n,) int32 array
        Flat index in the neighbour.
    seen : (n,) bool array
        Whether the neighbour shows the same there.
    in_frame : (n,) bool array
        Whether it is in the neighbour at all.
    """

    pixel: NDArray[np.int32]
    seen: Mask
    in_frame: Mask


@dataclass(frozen=True)
class Compared:
    """What some pixels of two frames say of each other.

    Attributes
    ----------
    tiles : (4, rows, columns) float64 array
        Of the pixels of each tile that match: their number, the sum of the differences
        of their light, the sum of the squared differences, and the sum of their own
        light.
    compared, matching : int
        How many pixels were compared, and how many match.
    compared_surfaces, matching_surfaces : int
        The same of pixels that show a surface, not the sky.
    surfaces : int
        How many pixels show a surface, compared or not.
    """

    tiles: NDArray[np.float64]
    compared: int
    matching: int
    compared_surfaces: int
    matching_surfaces: int
    surfaces: int


def tile_grid(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the rows and columns of tiles of a picture (H, W)."""
    return -(-shape[0] // TILE), -(-shape[1] // TILE)


def find_spots(pair: Pair, step: int) -> Spots:
    """Reproject every `step`th pixel of a frame, as if only the camera moved.

    Parameters
    ----------
    pair : Pair
        The frame and its neighbour.
    step : int
        Distance between the pixels, along both axes.

    Returns
    -------
    spots : Spots
    """
    return _call_for_spots(_make_spot_call(pair), pair, step)


def compare_spots(pair: Pair, step: int) -> Compared:
    """Compare every `step`th pixel of two frames, tile by tile.

    Pixels that move by themselves or are invalid are left out.

    Parameters
    ----------
    pair : Pair
        The frame and its neighbour.
    step : int
        Distance between the pixels compared, along both axes.

    Returns
    -------
    comparison : Compared
    """
    call = _make_spot_call(pair)
    spots = _call_for_spots(call, pair, step)
    tiles = np.zeros((4, *tile_grid(pair.here.shape)))
    counts = np.zeros(5, np.int64)
    library().compare_spots(
        call.target,
        call.target.all[0],
        step,
        *(x.ctypes.data for x in (spots.pixel, spots.seen, spots.in_frame)),
        *(x.ctypes.data for x in (tiles, counts)),
    )
    return Compared(tiles, *counts.tolist())


def _make_spot_call(pair: Pair) -> _Call:
    whole = Reprojected(pair, np.ones((1, 1), np.float32), 0.0)
    return _Call(Work(pair.here, None, 0.0, (), 1), [(whole, 0)])


def _call_for_spots(call: _Call, pair: Pair, step: int) -> Spots:
    height, width = pair.here.shape
    start = step // 2
    across = len(range(start, width, step))
    count = len(range(start, height, step)) * across
    pixel = np.empty(count, np.int32)
    seen, in_frame = np.empty((2, count), np.bool_)
    scratch = np.empty(8 * across, np.float32)
    library().find_spots(
        call.target,
        call.target.all[0],
        step,
        *(x.ctypes.data for x in (pixel, seen, in_frame, scratch)),
    )
    return Spots(pixel, seen, in_frame)


class _Call:
    """One call of the library, and the arrays that it reads."""

    def __init__(
        self, work: Work, neighbours: Sequence[tuple[Aligned | Reprojected, int]]
    ) -> None:
        self._work, self._arrays = work, Arrays()
        used = [(x, n) for x, n in neighbours if not x.pair or x.is_reused]
        pairs = [x.pair for x, _ in used if x.pair]
        frame, pixels = work.target, work.target.picture.shape[0]
        guide_penalty, change_penalty = penalties(frame.samples)
        self.target = structures.Target(
            frame=self._make_frame(frame, bool(pairs)),
            channels=frame.picture.shape[1],
            parts=len(work.lit),
            neighbours=len(used),
            guide_area=guide_area(frame.samples),
            leads=any(x.leads for x in pairs),
            usual=work.usual,
            guide_penalty=guide_penalty,
            change_penalty=change_penalty,
        )
        if frame.noise is not None:
            noise = frame.noise.guides
            self.target.guide_noise = self._arrays.at(noise, np.float16, pixels)
        if pairs:
            self._add_extent(pairs[0])
        self._all = (structures.Neighbour * max(len(used), 1))(
            *(self._make_neighbour(x, group) for x, group in used)
        )
        self.target.all = ctypes.cast(self._all, ctypes.POINTER(structures.Neighbour))

    def run(self) -> float:
        """Accumulate the whole frame; returns how many samples were reused."""
        height, width = self._work.target.shape
        lefts = range(0, width, _COLUMNS)
        areas = [
            structures.Area(top, bottom, left, min(left + _COLUMNS, width))
            for (top, bottom), left in product(bands(height), lefts)
        ]
        needed = library().scratch_bytes(self.target, areas[0])
        scratches: list[NDArray[np.uint8]] = []  # one of each thread

        def work(area: structures.Area) -> float:
            scratch = scratches.pop() if scratches else np.empty(needed, np.uint8)
            reused = library().accumulate(self.target, area, scratch.ctypes.data)
            scratches.append(scratch)
            return float(reused)

        return sum(in_threads(work, areas, self._work.threads))

    def _make_reprojected(self, pair: Pair) -> structures.Neighbour:
        """The structure of a neighbour without motion of its own."""
        turn = np.eye(3) if pair.turn is None else pair.turn
        result = structures.Neighbour(
            frame=self._make_frame(pair.there, True),
            forth=for_library(pair.forth, pair.here.shape, self._arrays),
            back=for_library(pair.back, pair.there.shape, self._arrays),
            jitters=pair.jitters,
            whole=pair.whole_motion,
        )
        result.turn[:] = turn.ravel().tolist()
        return result

    def _make_neighbour(
        self, neighbour: Aligned | Reprojected, group: int
    ) -> structures.Neighbour:
        if isinstance(neighbour, Aligned):
            result = structures.Neighbour(aligned=True)
            result.frame = self._make_frame(neighbour.other, False)
            result.turn[:] = np.eye(3).ravel().tolist()
        else:
            pair = neighbour.pair
            result = self._make_reprojected(pair)
            self._add_moving(result, pair)
            result.fall, result.most = neighbour.fall, neighbour.tiles.max()
            at_rims = _AT_RIMS if pair.leads else _AT_RIMS_OF_FEW
            result.at_rims = -at_rims / neighbour.fall if neighbour.fall else 0.0
            result.tile_rows, result.tile_columns = neighbour.tiles.shape
            if not (neighbour.tiles == 1.0).all():
                result.tiles = self._arrays.at(
                    neighbour.tiles, np.float32, neighbour.tiles.size
                )
            if self._work.images is not None:
                result.images = self._make_places(*self._work.images.positions(pair))
        result.group = group
        return result

    def _add_moving(self, result: structures.Neighbour, pair: Pair) -> None:
        motion = pair.object_motion
        if motion is None:
            return
        count = len(pair.there.picture)
        result.moving = self._arrays.at(motion.moving, np.bool_, count)
        result.moved = self._make_places(motion.pixels, motion.x, motion.y)

    def _make_places(
        self, pixels: NDArray[np.integer], x: Array, y: Array
    ) -> structures.Places:
        count, at = len(pixels), self._arrays.at
        flat = pixels.astype(np.int64, copy=False)
        return structures.Places(
            at(flat, np.int64, count),
            at(x.astype(np.float32, copy=False), np.float32, count),
            at(y.astype(np.float32, copy=False), np.float32, count),
            count,
        )

    def _add_extent(self, pair: Pair) -> None:
        least, most = (
            self._arrays.at(x, np.float32, len(pair.here.picture)) for x in pair.extent
        )
        self.target.least, self.target.most = least, most

    def _make_frame(self, frame: Stored, is_reprojected: bool) -> structures.Frame:
        (height, width), at = frame.shape, self._arrays.at
        count = height * width
        channels = frame.picture.shape[1]
        structure = structures.Frame(
            picture=at(frame.picture, np.float16, count * channels),
            depth=at(frame.inverse_depth, np.float32, count),
            counts=at(frame.counts, np.float16, count),
            invalid=at(frame.invalid, np.bool_, count),
            parts=self._make_parts(frame),
            width=width,
            height=height,
            number=frame.number % (1 << 32),
            samples=frame.samples,
        )
        if frame.noise is not None:
            structure.noise = at(frame.noise.light, np.float16, 2 * count)
        if is_reprojected:
            structure.rims = at(frame.rims, np.uint8, count)
        return structure

    def _make_parts(self, frame: Stored) -> Any:
        parts = [frame.parts[name] for name in self._work.lit]
        count = 3 * len(frame.picture)
        at = self._arrays.at
        return self._arrays.addresses([at(part, np.float16, count) for part in parts])
