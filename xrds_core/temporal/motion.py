"""Where every pixel of one frame was in another one, by geometry without noise.

A pixel's centre, with the depth seen there, is a point of the world; the other frame's
camera shows it elsewhere. That is linear in (x, y, 1, nearness), so one 4x4 matrix for
each pair of frames tells it, and another one for each object that moved. Nearness is
1 / depth for a perspective camera, 0 for the sky; for an orthographic one the depth.

A place counts where going there and back agrees: what the other frame shows there must
come from this pixel, to within a pixel of motion, and be as near as something in
the 9x9 pixels around it. This throws out whatever covers or uncovers the surface, and
leaves edges their mixed samples as long as both sides of the edge move alike. Choosing
samples by what shows at the pixel's own centre would choose by their content: edges
would lose what smooths them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .neighbours import extreme, extreme_at
from .panorama import Around, around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Camera, Matrix, Stored

    Passage = Array | Around

# Pixels by which motion there and motion back may differ; for things that move by
# themselves, whose edges are known less well, half as much.
_AGREEMENT = 1.0
AGREEMENT_OF_MOVING = 0.5
# What they differ by is as bad as this much distance from the true place (squared).
_AS_DISTANCE = 2.0
# Share of itself by which nearness may lie beyond what is around.
_NEARNESS_SLACK = 0.02
# What the nearer side of an edge moves apart from the other is as bad as this much
# distance (squared), up to a pixel. Where all is fine edges, 0.5 cost 0.2 dB and
# leaving such samples out a decibel.
_AS_DISTANCE_AT_RIMS, _MOST_AT_RIMS = 0.3, 1.0
# Cycles' first sample lies at the pixel's centre. Frames of a sample or two that move
# by whole pixels would all show the same points, and lines thinner than a pixel would
# break up. So there the pixel taken is off by chance, by up to this much. Moves count
# as whole where a pixel lands nearer to a centre than this, for each frame between.
_FEW_SAMPLES = 2.0
_OFF, _WHOLE = 0.6, 0.02
# Multiples of these spread evenly over a unit square (M. Roberts, R3 and R2 sequences).
_SPREAD_X = np.array([0.8191725134, 0.6710436067, 0.5497004779], np.float32)
_SPREAD_Y = np.array([0.7548776662, 0.5698402910, 0.6180339887], np.float32)


@dataclass(frozen=True)
class Grid:
    """The centres of some pixels (n,): of whole rows, or of any."""

    pixels: slice | NDArray[np.intp]
    x: Array
    y: Array


@dataclass(frozen=True)
class Places:
    """Where pixels were in another frame.

    `pixel`: flat index of the other frame's nearest pixel, 0 where not seen;
    `apart`: squared distance in pixels from the true place to that pixel's centre,
    what motion there and back leave over, and what moves otherwise beside it;
    `seen`: where the other frame shows the same. All (n,), in the order of the grid.
    """

    pixel: NDArray[np.int32]
    apart: Array
    seen: NDArray[np.bool_]


@dataclass(frozen=True)
class Detour:
    """What a pair of frames knows of things that moved by themselves.

    `pixels`: flat, ascending, those of this frame that show such things; `x` and
    `y`: where they were in the other frame, NaN where motion there and back does not
    agree. All (m,). `moving` (H W): which pixels of the other frame show such things,
    `beside` (H W), or None: which of this frame show something else, but may hold some
    of their light.
    """

    pixels: NDArray[np.intp]
    x: Array
    y: Array
    moving: NDArray[np.bool_]
    beside: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Pair:
    """Two frames, and how pixels pass from the one to the other and back."""

    here: Stored
    there: Stored
    forth: Passage
    back: Passage
    extent: tuple[Array, Array]
    detour: Detour | None = None


def world_of(camera: Camera) -> Matrix:
    """Return (4, 4): (x, y, 1, nearness) -> world point times w, in pixels of arrays.

    Nearness is 1 / depth for a perspective camera, the depth for an orthographic one.
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
    """Return (4, 4): world point -> (x w, y w, w, nearness w) in pixels of arrays."""
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


def passage(here: Camera, there: Camera) -> Passage:
    """Return (4, 4): (x, y, 1, nearness) here -> (x w, y w, w, nearness w) there.

    Panoramas have a passage of their own.
    """
    if here.sphere is not None and there.sphere is not None:
        return around(here, there)
    return (pixels_of(there) @ world_of(here)).astype(np.float32)


def pair(
    here: Stored,
    there: Stored,
    detour: Detour | None = None,
    extent: tuple[Array, Array] | None = None,
) -> Pair:
    """Return what `places` needs to know of two frames.

    `extent` is `surroundings` of `here`, for callers with many pairs.
    """
    forth = passage(here.camera, there.camera)
    back = passage(there.camera, here.camera)
    if detour is not None:
        detour = _with_rims(detour, here, there)
    return Pair(here, there, forth, back, extent or surroundings(here), detour)


def _with_rims(detour: Detour, here: Stored, there: Stored) -> Detour:
    """Return a detour that knows what lies beside things that moved by themselves.

    Edges are pixels of both sides. What stands still takes no part in such a pixel: the
    share of the thing that moves in it is another one in every frame.
    """
    own = np.zeros(here.nearness.shape, bool)
    own[detour.pixels] = True
    beside = _beside(own, here)
    moving = detour.moving | _beside(detour.moving, there)
    return replace(detour, moving=moving, beside=beside)


def _beside(mask: NDArray[np.bool_], frame: Stored) -> NDArray[np.bool_]:
    """Return the rims (H W) that are not in a mask (H W), but next to it."""
    wide = extreme(mask.reshape(frame.shape), np.logical_or).ravel()
    return np.asarray(wide & ~mask & frame.rims)


def surroundings(frame: Stored) -> tuple[Array, Array]:
    """Return the least and largest nearness in the 9x9 pixels around, with some slack.

    Less than 9x9 cost 1.4 dB on a house with fine rails: hits and misses of what is
    thinner than a pixel must not choose its samples.
    """
    nearness = frame.nearness.reshape(frame.shape)
    least, most = (
        extreme(extreme(nearness, smaller), smaller, step=3).ravel()
        for smaller in (np.fmin, np.fmax)
    )
    slack = np.float32(_NEARNESS_SLACK)
    return least * (1 - slack), most * (1 + slack)


def grid(shape: tuple[int, int], first: int = 0, last: int | None = None) -> Grid:
    """Return the centres of the pixels of rows `first` to `last` (excluded)."""
    height, width = shape
    last = height if last is None else last
    x = np.arange(width, dtype=np.float32) + np.float32(0.5)
    y = np.arange(first, last, dtype=np.float32) + np.float32(0.5)
    pixels = slice(first * width, last * width)
    return Grid(pixels, np.tile(x, last - first), np.repeat(y, width))


def carry(
    passage: Passage, x: Array, y: Array, nearness: Array
) -> tuple[Array, Array, Array]:
    """Return (x, y, nearness) there of pixels (n,) here; NaN behind the camera."""
    if isinstance(passage, Around):
        return passage.carry(x, y, nearness)
    across, down, w, near = (
        row[0] * x + row[1] * y + row[3] * nearness + row[2] for row in passage
    )
    w[~(w > 0.0)] = np.nan
    return across / w, down / w, near / w


def places(pair: Pair, grid: Grid) -> Places:
    """Find where rows of pixels of `pair.here` were in `pair.there`."""
    found, _ = still_places(pair, grid)
    _doubt_rims(found, pair, grid)
    return found if pair.detour is None else _detoured(found, pair, grid)


def still_places(pair: Pair, grid: Grid) -> tuple[Places, NDArray[np.bool_]]:
    """Find places as if nothing but the camera moved, and which lie in the frame."""
    near = pair.here.nearness[grid.pixels]
    x, y, _ = carry(pair.forth, grid.x, grid.y, near)
    found = nearest(x, y, pair.there.shape)
    _loosen(found, pair, grid, x, y)
    centre_x, centre_y = centres(found.pixel, pair.there.shape[1])
    near = pair.there.nearness.take(found.pixel)
    back_x, back_y, near = carry(pair.back, centre_x, centre_y, near)
    # what the way there and the way back leave over
    back_x += x - grid.x - centre_x
    back_y += y - grid.y - centre_y
    left = back_x**2 + back_y**2
    least, most = (part[grid.pixels] for part in pair.extent)
    seen = found.seen & (left < _AGREEMENT**2) & (near >= least) & (near <= most)
    left[~seen] = 0.0
    apart = found.apart + np.float32(_AS_DISTANCE) * left
    return Places(found.pixel, apart, seen), found.seen


def _loosen(found: Places, pair: Pair, grid: Grid, x: Array, y: Array) -> None:
    """Take another pixel by chance where places (n,) lie at the centres of theirs."""
    here, there = pair.here, pair.there
    frames = abs(there.number - here.number)
    stands = here.camera.same(replace(there.camera, window=here.camera.window))
    if here.samples > _FEW_SAMPLES or stands or not frames:
        return
    at = np.flatnonzero(found.seen & (found.apart < (_WHOLE * frames) ** 2))
    pixel = np.stack([grid.x[at], grid.y[at], np.full(len(at), there.number)])
    off_x, off_y = (
        np.float32(2 * _OFF) * ((spread @ pixel) % 1.0 - np.float32(0.5))
        for spread in (_SPREAD_X, _SPREAD_Y)
    )
    other = nearest(x[at] + off_x, y[at] + off_y, there.shape)
    found.pixel[at[other.seen]] = other.pixel[other.seen]


def _doubt_rims(found: Places, pair: Pair, grid: Grid) -> None:
    """Put farther apart what holds light of something nearer that moves otherwise.

    Pixels beside an edge hold some samples of the nearer side. What is nearer beside
    the pixel taken does not belong here, what is nearer here is missing there.
    """
    assert isinstance(grid.pixels, slice)
    here, there = pair.here, pair.there
    apart = np.zeros(len(found.apart), np.float32)
    at = np.flatnonzero(found.seen & here.rims[grid.pixels])
    apart[at] = _drift(pair.forth, here, at + grid.pixels.start)
    at = np.flatnonzero(found.seen & there.rims.take(found.pixel))
    apart[at] = np.fmax(apart[at], _drift(pair.back, there, found.pixel[at]))
    np.fmin(apart, np.float32(_MOST_AT_RIMS), out=apart)  # NaN behind the camera
    found.apart[...] += np.float32(_AS_DISTANCE_AT_RIMS) * apart


def _drift(way: Passage, frame: Stored, pixels: NDArray[np.integer]) -> Array:
    """Return the square of what the nearest surface beside flat pixels moves apart."""
    x, y = centres(pixels, frame.shape[1])
    own_x, own_y, _ = carry(way, x, y, frame.nearness.take(pixels))
    nearest = extreme_at(frame.nearness, pixels, frame.shape, frame.nearer)
    near_x, near_y, _ = carry(way, x, y, nearest)
    return (near_x - own_x) ** 2 + (near_y - own_y) ** 2


def _detoured(found: Places, pair: Pair, grid: Grid) -> Places:
    """Return places with those of moving things in theirs."""
    detour = pair.detour
    assert detour is not None
    assert isinstance(grid.pixels, slice)
    found.seen[...] &= ~detour.moving.take(found.pixel)
    if detour.beside is not None:
        found.seen[...] &= ~detour.beside[grid.pixels]
    part = slice(*detour.pixels.searchsorted((grid.pixels.start, grid.pixels.stop)))
    moved = nearest(detour.x[part], detour.y[part], pair.there.shape)
    inside = detour.pixels[part] - grid.pixels.start
    found.pixel[inside] = moved.pixel
    found.apart[inside] = moved.apart
    found.seen[inside] = moved.seen
    return found


def nearest(x: Array, y: Array, shape: tuple[int, int]) -> Places:
    """Return the pixels that hold places (n,); not seen where outside of the frame."""
    height, width = shape
    seen = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    x, y = np.where(seen, x, np.float32(0.5)), np.where(seen, y, np.float32(0.5))
    column, row = x.astype(np.int32), y.astype(np.int32)
    off_x, off_y = x - column - np.float32(0.5), y - row - np.float32(0.5)
    return Places(row * np.int32(width) + column, off_x**2 + off_y**2, seen)


def centres(pixels: NDArray[np.integer], width: int) -> tuple[Array, Array]:
    """Return the centres (x, y) of flat pixels (n,)."""
    row, column = np.divmod(pixels.astype(np.int32), np.int32(width))
    return column + np.float32(0.5), row + np.float32(0.5)


def known(x: Array, y: Array, mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return places with NaN outside of `mask`."""
    nan = np.float32(np.nan)
    return np.where(mask, x, nan), np.where(mask, y, nan)
