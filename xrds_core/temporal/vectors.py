"""The places of things that moved by themselves, by Cycles' Vector passes.

They hold for everything, deforming meshes too, and are followed from each frame to the
next, there and back. A place is given up at the first frame where the way back leads
elsewhere: something came before it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from .motion import (
    AGREEMENT_OF_MOVING,
    Detour,
    carry,
    centres,
    grid,
    known,
    nearest,
    passage,
)
from .neighbours import extreme

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Camera, Stored

    Mask = NDArray[np.bool_]
    Trail = tuple[Array, Array]  # x and y, NaN where lost

# Share of itself by which the nearness of a thing may change from frame to frame.
_NEARER = 0.1


class Movement:
    """Finds what moved by itself between the frames of a shot, by their Vector passes.

    One object serves a whole shot: what is known of a frame is kept while the frame is.
    Without Vector passes nothing is taken to move but the camera.
    """

    def __init__(self) -> None:
        self._moving: WeakKeyDictionary[Stored, dict[int, Mask]]
        self._moving = WeakKeyDictionary()

    def detours(self, here: Stored, others: Sequence[Stored]) -> list[Detour | None]:
        """Return for each of `others` the places of what moved by itself.

        Frames of one number as `here` show the same moment and need none. The way leads
        from each frame to the nearest that is there.
        """
        frames = {x.number: x for x in (*others, here) if x.vector is not None}
        trails: dict[int, Trail] = {}
        if here.vector is not None:
            for step in (-1, 1):
                trails |= self._trail(here, frames, step)
        return [
            None if x.number == here.number else self._detour(here, x, frames, trails)
            for x in others
        ]

    def _detour(
        self,
        here: Stored,
        there: Stored,
        frames: Mapping[int, Stored],
        trails: Mapping[int, Trail],
    ) -> Detour:
        pixels = np.flatnonzero(self.moving(here, frames))
        nowhere = np.full((2, len(pixels)), np.nan, np.float32)
        x, y = trails.get(there.number, nowhere)
        return Detour(pixels, x, y, self.moving(there, frames))

    def _trail(
        self, here: Stored, frames: Mapping[int, Stored], step: int
    ) -> dict[int, Trail]:
        """Follow the moving pixels of `here` frame by frame; number -> places."""
        x, y = centres(np.flatnonzero(self.moving(here, frames)), here.shape[1])
        trail, frame = {}, here
        while (after := _beside(frame, frames, step)) is not None:
            x, y = self._step(frame, after, frames, x, y)
            trail[after.number], frame = (x, y), after
        return trail

    def _step(
        self,
        here: Stored,
        there: Stored,
        frames: Mapping[int, Stored],
        x: Array,
        y: Array,
    ) -> tuple[Array, Array]:
        """Carry places (NaN: lost) into the frame before or after."""
        steps = there.number - here.number
        start = nearest(x, y, here.shape)
        flow_x, flow_y = _flow(here, start.pixel, steps)
        found = nearest(x + flow_x, y + flow_y, there.shape)
        back_x, back_y = _flow(there, found.pixel, -steps)
        with np.errstate(invalid="ignore"):  # infinite motion agrees with none
            left = (flow_x + back_x) ** 2 + (flow_y + back_y) ** 2
        was, near = here.nearness[start.pixel], there.nearness[found.pixel]
        agreed = (left < AGREEMENT_OF_MOVING**2) & (np.abs(near - was) < _NEARER * was)
        agreed &= self.moving(there, frames)[found.pixel] & found.seen & start.seen
        return known(x + flow_x, y + flow_y, agreed)

    def moving(self, frame: Stored, frames: Mapping[int, Stored]) -> Mask:
        """Return (H W): where the Vector pass is not what the cameras alone explain.

        The camera after the frame is asked, or the one before it where `frames` end;
        nothing that was asked earlier, so that a shot's parts agree with the whole. All
        is taken to move where no camera beside the frame is known.
        """
        known = self._moving.setdefault(frame, {})
        for step in (1, -1):
            beside = _beside(frame, frames, step)
            if beside is not None and frame.vector is not None:
                steps = beside.number - frame.number
                if steps not in known:
                    known[steps] = _unexplained(frame, beside.camera, steps)
                return known[steps]
        return np.full(frame.nearness.shape, frame.vector is not None)


def _beside(frame: Stored, frames: Mapping[int, Stored], step: int) -> Stored | None:
    """Return the nearest of `frames` after a frame, or before it (`step` -1)."""
    there = [n for n in frames if (n - frame.number) * step > 0]
    return frames[min(there, key=lambda n: n * step)] if there else None


def _unexplained(frame: Stored, beside: Camera, steps: int) -> Mask:
    """Return (H W): where the Vector pass differs from the camera's own motion.

    It is a mean over the pixel's samples, so it may lie anywhere between what the
    camera explains for the pixels around it.
    """
    own = grid(frame.shape)
    forth = passage(frame.camera, beside)
    x, y, _ = carry(forth, own.x, own.y, frame.nearness)
    flows = _flow(frame, slice(None), steps)
    apart = np.zeros(frame.shape, np.float32)
    for still, flow in ((x - own.x, flows[0]), (y - own.y, flows[1])):
        explained, given = still.reshape(frame.shape), flow.reshape(frame.shape)
        np.fmax(apart, extreme(explained, np.fmin) - given, out=apart)
        np.fmax(apart, given - extreme(explained, np.fmax), out=apart)
    hit = (frame.nearness > 0.0) | (frame.nearness < 0.0)  # neither sky nor NaN
    return np.asarray((apart.ravel() > AGREEMENT_OF_MOVING / 2) & hit)


def _flow(
    frame: Stored, pixels: NDArray[np.int32] | slice, steps: int
) -> tuple[Array, Array]:
    """Return (x, y downwards) in pixels to the frame `steps` later, or before.

    The pass leads one frame on; in a shot in steps, motion is taken to be even.
    """
    assert frame.vector is not None
    picked = frame.vector[pixels].astype(np.float32) * np.float32(abs(steps))
    return (-picked[:, 2], picked[:, 3]) if steps > 0 else (picked[:, 0], -picked[:, 1])
