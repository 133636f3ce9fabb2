"""Object motion vectors: where moving objects were in other frames, by Vector passes.

They cover everything, deforming meshes included, and are chained from frame to frame,
forwards and backwards. A pixel is lost at the first frame where the backward vector
leads elsewhere: it was occluded there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ..native.library import Arrays, bands, in_threads, library
from .reprojection import (
    MOVING_TOLERANCE,
    ObjectMotion,
    centres,
    known,
    nearest,
    reprojection,
)
from .weighted_sums import for_library

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .camera import Camera
    from .frame import Stored

    Mask = NDArray[np.bool_]
    VectorChain = tuple[Array, Array]  # x and y, NaN where lost


# Relative change of an object's inverse depth that is allowed from frame to frame.
_NEARER = 0.1


class Movement:
    """Finds the object motion between the frames of a shot, from their Vector passes.

    One instance serves a whole shot: results for a frame are cached while the frame
    exists. Without Vector passes nothing but the camera is assumed to move.
    """

    def __init__(self) -> None:
        self._moving: WeakKeyDictionary[Stored, dict[int, Mask]]
        self._moving = WeakKeyDictionary()

    def object_motions(
        self, here: Stored, others: Sequence[Stored]
    ) -> list[ObjectMotion | None]:
        """Return where the moving objects of a frame were in its neighbours.

        Vectors are chained from each frame to the nearest one available.

        Parameters
        ----------
        here : Stored
            The frame.
        others : sequence of Stored
            Its neighbours.

        Returns
        -------
        motions : list of ObjectMotion or None
            One for each of `others`. None for a frame with the number of `here`: it
            shows the same moment.
        """
        frames = {
            frame.number: frame for frame in (*others, here) if frame.vector is not None
        }
        chains: dict[int, VectorChain] = {}
        if here.vector is not None:
            for step in (-1, 1):
                chains |= self._chain_vectors(here, frames, step)
        return [
            None
            if other.number == here.number
            else self._find_object_motion(here, other, frames, chains)
            for other in others
        ]

    def _find_object_motion(
        self,
        here: Stored,
        there: Stored,
        frames: Mapping[int, Stored],
        chains: Mapping[int, VectorChain],
    ) -> ObjectMotion:
        pixels = np.flatnonzero(self.moving(here, frames))
        nowhere = np.full((2, len(pixels)), np.nan, np.float32)
        x, y = chains.get(there.number, nowhere)
        return ObjectMotion(pixels, x, y, self.moving(there, frames))

    def _chain_vectors(
        self, here: Stored, frames: Mapping[int, Stored], step: int
    ) -> dict[int, VectorChain]:
        """Follow the moving pixels of `here` frame by frame; number -> positions."""
        x, y = centres(np.flatnonzero(self.moving(here, frames)), here.shape[1])
        chain, frame = {}, here
        while (after := _find_adjacent(frame, frames, step)) is not None:
            x, y = self._follow_vectors(frame, after, frames, x, y)
            chain[after.number], frame = (x, y), after
        return chain

    def _follow_vectors(
        self,
        here: Stored,
        there: Stored,
        frames: Mapping[int, Stored],
        x: Array,
        y: Array,
    ) -> tuple[Array, Array]:
        """Move positions (NaN: lost) to the frame before or after."""
        steps = there.number - here.number
        start = nearest(x, y, here.shape)
        flow_x, flow_y = _read_flow(here, start.pixel, steps)
        end = nearest(x + flow_x, y + flow_y, there.shape)
        back_x, back_y = _read_flow(there, end.pixel, -steps)
        with np.errstate(invalid="ignore"):  # infinite motion is never consistent
            left = (flow_x + back_x) ** 2 + (flow_y + back_y) ** 2
        was, near = here.inverse_depth[start.pixel], there.inverse_depth[end.pixel]
        consistent = (left < MOVING_TOLERANCE**2) & (np.abs(near - was) < _NEARER * was)
        consistent &= self.moving(there, frames)[end.pixel] & end.seen & start.seen
        return known(x + flow_x, y + flow_y, consistent)

    def moving(self, frame: Stored, frames: Mapping[int, Stored]) -> Mask:
        """Find the pixels whose motion vectors camera motion alone does not explain.

        The camera's motion is that to the next frame, or to the previous one where
        `frames` end. What other calls have found plays no part, so that a part of a
        shot gives the same result as the whole. Without an adjacent frame everything is
        assumed to move.

        Parameters
        ----------
        frame : Stored
            The frame to look at.
        frames : mapping of int to Stored
            Frames of the shot with Vector passes, by number.

        Returns
        -------
        moving : (H W,) bool array
        """
        masks = self._moving.setdefault(frame, {})
        for step in (1, -1):
            beside = _find_adjacent(frame, frames, step)
            if beside is not None and frame.vector is not None:
                steps = beside.number - frame.number
                if steps not in masks:
                    masks[steps] = _find_unexplained(frame, beside.camera, steps)
                return masks[steps]
        return np.full(frame.inverse_depth.shape, frame.vector is not None)


def _find_adjacent(
    frame: Stored, frames: Mapping[int, Stored], step: int
) -> Stored | None:
    """Return the nearest of `frames` after a frame, or before it (`step` -1)."""
    numbers = [n for n in frames if (n - frame.number) * step > 0]
    return frames[min(numbers, key=lambda n: n * step)] if numbers else None


def _find_unexplained(frame: Stored, beside: Camera, steps: int) -> Mask:
    """Return (H W): where the Vector pass differs from the camera's own motion.

    The pass is a mean over the pixel's samples, so it may have any value between the
    camera's motion vectors of the surrounding pixels.
    """
    assert frame.vector is not None
    height, width = frame.shape
    count = height * width
    arrays = Arrays()
    forth = for_library(reprojection(frame.camera, beside), frame.shape, arrays)
    depth = arrays.at(frame.inverse_depth, np.float32, count)
    vectors = arrays.at(frame.vector, np.float16, 4 * count)
    moving = np.empty(count, np.bool_)

    def work(rows: tuple[int, int]) -> None:
        scratch = np.empty(6 * (width + 18), np.float32)
        given = (*rows, steps, MOVING_TOLERANCE / 2)
        places = moving.ctypes.data, scratch.ctypes.data
        library().find_moving(depth, vectors, forth, width, height, *given, *places)

    in_threads(work, bands(height))
    return moving


def _read_flow(
    frame: Stored, pixels: NDArray[np.int32] | slice, steps: int
) -> tuple[Array, Array]:
    """Return (x, y downwards) in pixels to the frame `steps` later, or before.

    The pass covers one frame; over several, motion is assumed to be uniform.
    """
    assert frame.vector is not None
    vectors = frame.vector[pixels].astype(np.float32) * np.float32(abs(steps))
    return (
        (-vectors[:, 2], vectors[:, 3])
        if steps > 0
        else (vectors[:, 0], -vectors[:, 1])
    )
