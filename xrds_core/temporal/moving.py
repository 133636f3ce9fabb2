"""The places of things that move by themselves: by object matrices, or by Vector passes.

Matrices are exact over any number of frames but need to know which object a pixel
shows, and hold for rigid things. Vector passes hold for everything, deforming meshes
too, and are followed from each frame to the next, there and back; a place is given up
at the first frame where the way back leads elsewhere, so that something came before it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from .motion import AGREEMENT, Detour, carry, grid, nearest, passage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from .frame import Array, Camera, Matrix, Stored

    Mask = NDArray[np.bool_]

# Of an object's matrix, relative to its largest number: less is no motion.
_SAME_MATRIX = 1e-6


def by_matrices(here: Stored, there: Stored) -> Detour | None:
    """Return the places of what moved between two frames; None if nothing did.

    Both frames need an index. Objects that one of them does not know are seen nowhere.
    """
    assert here.index is not None
    assert there.index is not None
    names = _moved(here.matrices, there.matrices)
    if not names:
        return None
    moving = np.isin(there.index, names)
    pixels = np.flatnonzero(np.isin(here.index, names))
    x, y = np.full((2, len(pixels)), np.nan, np.float32)
    shown = here.index[pixels]
    for name in names:
        part = np.flatnonzero(shown == name)
        if part.size and name in here.matrices and name in there.matrices:
            x[part], y[part] = _rigid(here, there, name, pixels[part])
    return Detour(pixels, x, y, moving)


def _moved(here: Mapping[int, Matrix], there: Mapping[int, Matrix]) -> list[int]:
    names = []
    for name in here.keys() | there.keys():
        old, new = here.get(name), there.get(name)
        if old is None or new is None:
            names.append(name)
        elif not np.allclose(old, new, rtol=0, atol=_SAME_MATRIX * np.abs(old).max()):
            names.append(name)
    return sorted(names)


def _rigid(
    here: Stored, there: Stored, name: int, pixels: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Return where pixels of one object were, NaN where there and back differ."""
    assert there.index is not None
    moved = there.matrices[name] @ np.linalg.inv(here.matrices[name])
    own_x, own_y = _centres(pixels, here.shape[1])
    forth = passage(here.camera, there.camera, moved)
    x, y = carry(forth, own_x, own_y, here.nearness[pixels])
    found = nearest(x, y, there.shape)
    centre_x, centre_y = _centres(found.pixel, there.shape[1])
    back = passage(there.camera, here.camera, np.linalg.inv(moved))
    back_x, back_y = carry(back, centre_x, centre_y, there.nearness[found.pixel])
    off_x, off_y = x - own_x + back_x - centre_x, y - own_y + back_y - centre_y
    same = found.seen & (there.index[found.pixel] == name)
    return _known(x, y, same & (off_x**2 + off_y**2 < AGREEMENT**2))


class VectorPasses:
    """Follows the Vector passes of a shot's frames; keeps each frame's moving pixels.

    One object serves a whole shot: what is known of a frame is kept while the frame is.
    """

    def __init__(self) -> None:
        self._moving: WeakKeyDictionary[Stored, Mask] = WeakKeyDictionary()

    def detours(self, here: Stored, others: Sequence[Stored]) -> dict[int, Detour]:
        """Return, by position in ``others``, the places of what moved by itself.

        Frames of one number as ``here`` show the same moment and need none. Where a
        frame in between is missing nothing moving is known beyond it.
        """
        frames = {x.number: x for x in (*others, here) if x.vector is not None}
        trails = {}
        if here.vector is not None:
            for step in (-1, 1):
                trails |= self._trail(here, frames, step)
        places = {x: i for i, x in enumerate(others) if x.number != here.number}
        return {
            i: self._detour(here, other, frames, trails) for other, i in places.items()
        }

    def _detour(
        self,
        here: Stored,
        there: Stored,
        frames: Mapping[int, Stored],
        trails: Mapping[int, tuple[Array, Array]],
    ) -> Detour:
        pixels = np.flatnonzero(self.moving(here, frames))
        nowhere = np.full((2, len(pixels)), np.nan, np.float32)
        x, y = trails.get(there.number, nowhere)
        return Detour(pixels, x, y, self.moving(there, frames))

    def _trail(
        self, here: Stored, frames: Mapping[int, Stored], step: int
    ) -> dict[int, tuple[Array, Array]]:
        """Follow the moving pixels of ``here`` frame by frame; number -> places."""
        x, y = _centres(np.flatnonzero(self.moving(here, frames)), here.shape[1])
        trail, frame = {}, here
        while (after := frames.get(frame.number + step)) is not None:
            x, y = self._step(frame, after, frames, x, y)
            trail[after.number], frame = (x, y), after
        return trail

    def _step(
        self, here: Stored, there: Stored, frames: Mapping[int, Stored], x: Array, y: Array
    ) -> tuple[Array, Array]:
        """Carry places (NaN: lost) into the frame before or after."""
        forward = there.number > here.number
        start = nearest(x, y, here.shape)
        flow_x, flow_y = _flow(here, start.pixel, forward)
        found = nearest(x + flow_x, y + flow_y, there.shape)
        back_x, back_y = _flow(there, found.pixel, not forward)
        agreed = (flow_x + back_x) ** 2 + (flow_y + back_y) ** 2 < AGREEMENT**2
        agreed &= self.moving(there, frames)[found.pixel] & found.seen & start.seen
        return _known(x + flow_x, y + flow_y, agreed)

    def moving(self, frame: Stored, frames: Mapping[int, Stored]) -> Mask:
        """Return (H W): where the Vector pass is not what the cameras alone explain.

        All is taken to move where no camera beside the frame is known.
        """
        mask = self._moving.get(frame)
        if mask is None:
            mask = self._moving[frame] = _moving(frame, frames)
        return mask


def _moving(frame: Stored, frames: Mapping[int, Stored]) -> Mask:
    for forward in (True, False):
        beside = frames.get(frame.number + (1 if forward else -1))
        if beside is not None and frame.vector is not None:
            return _unexplained(frame, beside.camera, forward)
    return np.full(frame.shape[0] * frame.shape[1], frame.vector is not None)


def _unexplained(frame: Stored, beside: Camera, forward: bool) -> Mask:
    """Return (H W): where the Vector pass differs from the camera's own motion.

    It is a mean over the pixel's samples, so it may lie anywhere between what the
    camera explains for the pixels around it.
    """
    centres = grid(frame.shape)
    x, y = carry(passage(frame.camera, beside), centres.x, centres.y, frame.nearness)
    flows = _flow(frame, slice(None), forward)
    apart = np.zeros(frame.shape, np.float32)
    for still, flow in zip((x - centres.x, y - centres.y), flows, strict=True):
        least, most = _around(still.reshape(frame.shape))
        flow = flow.reshape(frame.shape)
        # NaN, of what has no depth, is no motion
        apart = np.fmax(apart, np.fmax(least - flow, flow - most))
    return np.asarray(apart > AGREEMENT / 2).ravel()


def _around(x: Array) -> tuple[Array, Array]:
    """Return the least and largest value of each 3x3 pixels."""
    least = most = np.pad(x, 1, "edge")
    for axis in (0, 1):
        parts = [least, most]
        for i, smaller in enumerate((np.fmin, np.fmax)):
            whole = parts[i]
            size = whole.shape[axis] - 2
            a, b, c = (np.take(whole, range(k, k + size), axis=axis) for k in range(3))
            parts[i] = smaller(smaller(a, b), c)
        least, most = parts
    return least, most


def _flow(
    frame: Stored, pixels: NDArray[np.int32] | slice, forward: bool
) -> tuple[Array, Array]:
    """Return (x, y downwards) in pixels to the next frame, or to the previous one."""
    assert frame.vector is not None
    picked = frame.vector[pixels].astype(np.float32)
    return (-picked[:, 2], picked[:, 3]) if forward else (picked[:, 0], -picked[:, 1])


def _centres(pixels: NDArray[np.integer], width: int) -> tuple[Array, Array]:
    row, column = np.divmod(pixels.astype(np.int32), np.int32(width))
    return column + np.float32(0.5), row + np.float32(0.5)


def _known(x: Array, y: Array, known: Mask) -> tuple[Array, Array]:
    nan = np.float32(np.nan)
    return np.where(known, x, nan), np.where(known, y, nan)
