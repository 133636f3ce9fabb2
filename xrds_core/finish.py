"""Finishes a frame, of a still or of a shot: accumulates samples and denoises them.

A still is a frame without neighbours.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .accumulation.accumulate import Accumulated, accumulate, sample_counts
from .accumulation.local_filters import BLOCK, block_means, box, extreme
from .denoising.light_sums import added_up, completed, light_in

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from .accumulation.frame import Stored
    from .accumulation.object_motion import Movement
    from .arrays import Array
    from .denoising import Denoised, Denoiser
    from .denoising.light_passes import LightPart


Rectangle = tuple[slice, slice]
"""Rows and columns."""


def rectangles(blocks: NDArray[np.bool_], most: int = 4) -> list[Rectangle]:
    """Cover marked blocks with a few rectangles.

    The rectangle that gains most by it is divided in two, as long as that leaves out a
    quarter of it.

    Parameters
    ----------
    blocks : (rows, columns) bool array
        The marked blocks.
    most : int
        Most rectangles to return.

    Returns
    -------
    rectangles : list of Rectangle
        Rows and columns of blocks; all marked blocks lie in one of them.
    """
    areas = [bounds for bounds in (_find_bounds(blocks),) if bounds is not None]
    while areas and len(areas) < most:
        splits = [(_split_in_two(blocks, area), area) for area in areas]
        (parts, gain), divided = max(splits, key=lambda split: split[0][1])
        if not parts or gain < 0.25 * _blocks_in(divided):
            break
        areas.remove(divided)
        areas += parts
    return areas


def _find_bounds(blocks: NDArray[np.bool_]) -> Rectangle | None:
    rows, columns = (np.flatnonzero(blocks.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _split_in_two(
    blocks: NDArray[np.bool_], area: Rectangle
) -> tuple[list[Rectangle], float]:
    """Return the two bounds that cover the least, and how much they leave out."""
    best: list[Rectangle] = []
    gain = 0.0
    for axis in (0, 1):
        for place in range(area[axis].start + 1, area[axis].stop):
            parts = []
            for part in (slice(area[axis].start, place), slice(place, area[axis].stop)):
                cut = (part, area[1]) if axis == 0 else (area[0], part)
                inside = _find_bounds(blocks[cut])
                if inside is not None:
                    parts.append(_shift(inside, cut))
            left_out = _blocks_in(area) - sum(map(_blocks_in, parts))
            if len(parts) == 2 and left_out > gain:
                best, gain = parts, left_out
    return best, gain


def _shift(inside: Rectangle, start: Rectangle) -> Rectangle:
    rows, columns = (
        slice(x.start + s.start, x.stop + s.start)
        for x, s in zip(inside, start, strict=True)
    )
    return rows, columns


def _blocks_in(rectangle: Rectangle) -> int:
    rows, columns = rectangle
    return int((rows.stop - rows.start) * (columns.stop - columns.start))


# The accumulated picture has full weight from this many reused samples for each of the
# frame's own, and this many in all: few samples say little.
_ENOUGH, _IN_ALL = 1.0, 3.0
# Where less is usual around a pixel, less is enough: a denoiser mistakes for detail
# what has more noise than its neighbours. Full weight has what is not below the usual
# over `_APART`. What is usual is the mean over `_USUAL` pixels across, the largest
# within `_NEAR` of them.
_APART, _USUAL, _NEAR = 1.5, 33, 24
# What is missing in the 3x3 pixels around a pixel counts against it, times half of the
# frame's samples, clipped to this range: the less noise there is, the more visible a
# few noisy pixels are.
_LEAST_FACTOR, _MOST_FACTOR = 1.0, 2.0
_SMOOTH = 3  # pixels across
# Beyond so many samples a denoiser bears what lacks samples along thin lines, as at
# edges, where the frame alone would bring its noise back: a pixel to each side for each
# doubling.
_THICK = 4.0
# Blocks that lack less than this on the mean, and lie beside none that lacks more, lose
# nothing that is seen, and the frame alone is not denoised for them.
_BEARABLE = 0.1
_RAMP = 17  # pixels across, at the border of such blocks
# The frame alone is denoised in parts where these are less than this much of it.
_PART = 0.75
AROUND = 96
"""Pixels around a part that a denoiser's network sees."""


@dataclass(frozen=True)
class Finished:
    """A finished frame.

    Attributes
    ----------
    denoised : Denoised
        The picture, or the requested region of it, with the alpha of `accumulated` if
        it has one.
    accumulated : Accumulated
        The samples that were denoised.
    seconds : dict of str to float
        Wall-clock time by stage: accumulate, denoise, and again: what of the
        frame alone was denoised as well.
    parts : mapping of str to (H, W, 3) float32 array
        AOVs and light passes, which add up to the picture, by name; the colours that
        some are divided by, under `LightPart.colour_name`.
    """

    denoised: Denoised
    accumulated: Accumulated
    seconds: dict[str, float]
    parts: Mapping[str, Array] = field(default_factory=dict)

    @property
    def picture(self) -> Array:
        """Radiance and alpha, where there is one: (H, W, 3) or (H, W, 4)."""
        return self.denoised.radiance

    def within(self, region: Rectangle) -> Finished:
        """Return the same of a part of what was denoised."""
        picture = replace(self.denoised, radiance=self.picture[region])
        return replace(self, denoised=picture, parts=_crop(self.parts, region))


def finish_frame(
    own: Stored,
    neighbours: Sequence[Stored],
    denoiser: Denoiser,
    movement: Movement,
    progress: Callable[[float], bool] | None = None,
    *,
    region: tuple[slice, slice] | None = None,
    accumulated: Accumulated | None = None,
    light: Sequence[LightPart] = (),
    strength: float = 1.0,
) -> Finished:
    """Accumulate the samples of neighbour frames on a frame and denoise it.

    Where a frame has few samples, and few are reused, the picture is that of the frame
    alone, also denoised: next to pixels of many samples a denoiser mistakes the noise
    of few for detail. Where that is a small part of the picture, that part alone is
    denoised again. Pixels at which neighbours do not count at all are those of the
    frame alone to the bit.

    Parameters
    ----------
    own : Stored
        The frame.
    neighbours : sequence of Stored
        Frames whose samples it may reuse; none for a still.
    denoiser : Denoiser
        The denoiser.
    movement : Movement
        Cache of the shot's object motion.
    progress : callable, optional
        Takes the fraction done, in [0, 1]; False as its result cancels.
    region : tuple of slice, optional
        Rows and columns to denoise; all by default. Black around a crop would give the
        denoiser a wrong exposure.
    accumulated : Accumulated, optional
        The frame with its neighbours' samples, if it is known already.
    light : sequence of LightPart
        AOVs and light passes to denoise as well.
    strength : float
        How much neighbours count, as in `accumulate`.

    Returns
    -------
    finished : Finished
        The denoised picture and its parts.

    Raises
    ------
    Cancelled
        If `progress` requests it.
    """
    started = time.perf_counter()
    if accumulated is None:
        accumulated = accumulate(own, neighbours, movement, strength=strength)
    region = region or (slice(None), slice(None))
    areas: list[_Area] = []
    uncounted = np.broadcast_to(own.strengths(strength) == 0.0, own.shape)
    is_exact = bool(uncounted[region].any())
    if neighbours and not uncounted.all():
        share = np.where(uncounted, np.float32(0.0), _find_weights(accumulated, own))
        share = share[region]
        areas = _find_lacking_areas(share, is_exact)
    denoise_started = time.perf_counter()
    parts = 1 + len(areas)
    passes = _Passes.of(accumulated, light, region)
    callbacks = [_progress_of_part(progress, number, parts) for number in range(parts)]
    denoised = passes.denoised(denoiser, callbacks[0])
    again_started = time.perf_counter()
    if areas:
        alone = accumulate(own, [])
        if not is_exact:
            alone = alone.filled(accumulated)
        lacking = _Passes.of(alone, light, region, like=denoised.parts)
        mixed = denoised.radiance.copy()
        for area, done in zip(areas, callbacks[1:], strict=True):
            single = lacking.within(area.around).denoised(denoiser, done)
            weight = share[area.place][..., None]
            pairs = [(mixed, single.radiance)]
            pairs += [(x, single.parts[k]) for k, x in denoised.parts.items()]
            for whole, part in pairs:
                inner = part[area.within]
                whole[area.place] = inner + (whole[area.place] - inner) * weight
        denoised = replace(denoised, radiance=mixed)
    again = time.perf_counter() - again_started
    names = dict.fromkeys(
        light_part.colour_name for light_part in light if light_part.colour
    )
    colours = {name: completed(accumulated.parts[name][region]) for name in names}
    finished_light = colours | added_up(
        denoised.radiance, denoised.parts, light, colours
    )
    seconds = {
        "accumulate": denoise_started - started,
        "denoise": time.perf_counter() - denoise_started - again,
        "again": again,
    }
    return Finished(denoised, accumulated, seconds, finished_light)


def _find_weights(accumulated: Accumulated, own: Stored) -> Array:
    """Return (H, W) in [0, 1]: the weight of the accumulated picture.

    It depends on how many samples are reused for each of the frame's `own`.
    """
    samples = own.samples
    enough = np.float32(max(_ENOUGH, _IN_ALL / samples))
    most = _APART * (1.0 + enough)
    alone = sample_counts(own)
    if own.invalid is not None:
        alone[own.invalid] = 0.0
    alone = alone.reshape(own.shape)
    with np.errstate(divide="ignore", invalid="ignore"):  # where the frame has none
        times = np.clip(accumulated.samples / alone, 1.0, most)
    times = np.where(alone > 0.0, times, most).astype(np.float32)
    usual = extreme(box(times, _USUAL), np.fmax, _NEAR)
    reused = np.clip((times * most / usual - 1.0) / enough, 0.0, 1.0)
    factor = np.float32(np.clip(samples / 2.0, _LEAST_FACTOR, _MOST_FACTOR))
    around = 1.0 - factor * (1.0 - box(reused, _SMOOTH))
    share = np.clip(np.minimum(reused, around), 0.0, 1.0)
    share = np.clip(box(share, _SMOOTH), 0.0, 1.0)
    share = _close_gaps(share, max(round(np.log2(samples / _THICK)), 0))
    return _limit_to_lacking_blocks(share)


def _close_gaps(share: Array, reach: int) -> Array:
    """Return a weight (H, W) without thin low values, `reach` pixels to each side."""
    for smaller in (np.fmax, np.fmin):
        for _ in range(reach):
            share = extreme(share, smaller)
    return share


def _limit_to_lacking_blocks(share: Array) -> Array:
    """Return a weight (H, W) that is 1 in blocks which lack few samples."""
    lacking = block_means(1.0 - share) > _BEARABLE
    if not lacking.any():
        return np.ones_like(share)
    blocks = extreme(lacking, np.logical_or)
    if blocks.all():
        return share
    pixels = blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
    pixels = pixels[: share.shape[0], : share.shape[1]].astype(np.float32)
    inside = np.clip(2.0 * box(pixels, _RAMP) - 1.0, 0.0, 1.0)
    return np.asarray(1.0 - (1.0 - share) * inside)


class _Area(NamedTuple):
    """A `place` of a picture, what is seen `around` it, and the place `within` that."""

    place: Rectangle
    around: Rectangle
    within: Rectangle


def _find_lacking_areas(share: Array, is_exact: bool) -> list[_Area]:
    """Return where the frame alone is needed, too; nowhere if one picture is enough.

    All of it if it `is_exact`: a part of a picture is denoised a little otherwise.
    """
    whole = (slice(0, share.shape[0]), slice(0, share.shape[1]))
    if is_exact:
        return [_Area(whole, whole, whole)]
    if (share == share.flat[0]).all() and float(share.flat[0]) in (0.0, 1.0):
        return []
    blocks = rectangles(block_means(np.less(share, 1.0)) > 0.0)
    areas = [_make_area(rectangle, share.shape) for rectangle in blocks]
    if sum(share[area.around].size for area in areas) < _PART * share.size:
        return areas
    return [_Area(whole, whole, whole)]


def _make_area(blocks: Rectangle, shape: tuple[int, ...]) -> _Area:
    place, around, within = [], [], []
    for part, side in zip(blocks, shape, strict=True):
        first, last = part.start * BLOCK, min(part.stop * BLOCK, side)
        before = max(first - AROUND, 0)
        place.append(slice(first, last))
        around.append(slice(before, min(last + AROUND, side)))
        within.append(slice(first - before, last - before))
    return _Area(*((x[0], x[1]) for x in (place, around, within)))


class _Passes(NamedTuple):
    """What is denoised: radiance, with alpha where there is one, guides, and parts."""

    noisy: Array
    albedo: Array
    normal: Array
    parts: dict[str, Array]

    @classmethod
    def of(
        cls,
        frame: Accumulated,
        light: Sequence[LightPart],
        region: tuple[slice, slice],
        like: Collection[str] | None = None,
    ) -> _Passes:
        """Those of a region of a frame, with the parts that `like` names, if given."""
        noisy = frame.radiance
        assert noisy is not None
        parts = light_in(noisy, frame.parts, light, like)
        if frame.alpha is not None:
            noisy = np.dstack((noisy, frame.alpha))
        return cls(noisy, frame.albedo, frame.normal, parts).within(region)

    def within(self, region: tuple[slice, slice]) -> _Passes:
        """Those of a region."""
        noisy, albedo, normal = (np.ascontiguousarray(x[region]) for x in self[:3])
        return _Passes(noisy, albedo, normal, _crop(self.parts, region))

    def denoised(
        self, denoiser: Denoiser, progress: Callable[[float], bool] | None
    ) -> Denoised:
        return denoiser(*self[:3], parts=self.parts, progress=progress)


def _crop(passes: Mapping[str, Array], region: tuple[slice, slice]) -> dict[str, Array]:
    return {name: np.ascontiguousarray(x[region]) for name, x in passes.items()}


def _progress_of_part(
    progress: Callable[[float], bool] | None, number: int, parts: int
) -> Callable[[float], bool] | None:
    """Return a callback that reports the progress of one of equal parts."""
    if progress is None or parts == 1:
        return progress
    return lambda done: progress((number + done) / parts)
