"""What kernels read of a frame and of the pairs that it makes with its neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..temporal.similarity import guide_area, penalties
from .frames import known
from .step import STEP, flagged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from ..temporal.accumulate import Reprojected
    from ..temporal.candidates import Images
    from ..temporal.frame import Stored
    from ..temporal.motion import ObjectMotion
    from .frames import FramesOnCard

_NO_SLOT = 0xFFFFFFFF


class Target:
    """A frame on a card, and what all its bands and neighbours share.

    `step` is the uniform of kernels that read this frame alone.
    """

    def __init__(
        self, frames: FramesOnCard, frame: Stored, images: Images | None, usual: float
    ) -> None:
        assert frame.noise is not None
        self.frames, self.frame, self.card = frames, frame, frames.card
        self.buffers = frames.of(frame)
        self.noise_of_guides = self.card.upload(frame.noise.guides.astype(np.float32))
        self.has_images = images is not None
        self.image = self.lattice = None
        self._extent: Any | None = None
        self._slots: tuple[NDArray[np.intp], Any] | None = None
        self._pairs: dict[int, PairOnCard] = {}
        step = np.zeros((), STEP)
        step["size"] = frame.shape[::-1]
        step["channels"] = frame.picture.shape[1]
        step["samples"], step["usual"] = frame.samples, usual
        step["guides"], step["changes"] = penalties(frame.samples)
        step["area"] = guide_area(frame.samples) // 2
        if images is not None:
            assert frame.image is not None
            self.image = self.card.upload(known(frame.image))
            self.lattice = self.card.upload(known(images.lattice))
            step["stride"], step["spots"] = images.stride, images.lattice.shape[1]
        self.step = flagged(
            step,
            here_half=self.buffers.is_half,
            here_counts=self.buffers.counts is not None,
        )

    def pair(self, neighbour: Reprojected) -> PairOnCard:
        """What kernels read of a pair, uploaded once for all bands."""
        key = id(neighbour)
        if key not in self._pairs:
            self._pairs[key] = PairOnCard(self, neighbour)
        return self._pairs[key]

    def extent(self, extent: tuple[Array, Array]) -> Any:
        """The range of inverse depth around each pixel; the same for all pairs."""
        if self._extent is None:
            both = np.empty((len(extent[0]), 2), np.float32)
            for place, values in enumerate(extent):
                both[:, place] = known(values)
            self._extent = self.card.upload(both)
        return self._extent

    def slots(self, pixels: NDArray[np.intp]) -> Any:
        """The place of each pixel among those that move; the same for all pairs."""
        if self._slots is None or not np.array_equal(self._slots[0], pixels):
            slots = np.full(self.frame.inverse_depth.shape, _NO_SLOT, np.uint32)
            slots[pixels] = np.arange(len(pixels), dtype=np.uint32)
            self._slots = pixels, self.card.upload(slots)
        return self._slots[1]


class PairOnCard:
    """A pair of frames: the step of its kernel, and the buffers that are its own.

    `slots`, `moved` and `masks` are None where nothing moves by itself.
    """

    def __init__(self, here: Target, neighbour: Reprojected) -> None:
        pair, card = neighbour.pair, here.card
        self.tiles = card.upload(neighbour.tiles)
        self.extent = here.extent(pair.extent)
        self.slots = self.moved = self.masks = None
        motion = pair.object_motion
        if motion is not None:
            self._upload_motion(here, motion)
        step = here.step.copy()
        step["forth"], step["back"] = pair.forth, pair.back
        step["coarse"] = neighbour.tiles.shape[::-1]
        step["coarse_most"] = neighbour.tiles.max()
        step["fall"] = neighbour.fall
        step["apart"] = pair.there.number - pair.here.number
        step["number"] = pair.there.number % (1 << 32)
        step["whole"] = pair.whole_motion
        if pair.turn is not None:
            step["turn"][:, :3] = pair.turn
        self.step = flagged(
            step,
            jitter=pair.jitters,
            orthographic=pair.here.camera.orthographic,
            images=here.has_images,
            turned=pair.turn is not None,
            moving=motion is not None,
            beside=motion is not None and motion.beside is not None,
        )

    def _upload_motion(self, here: Target, motion: ObjectMotion) -> None:
        masks = [motion.moving]
        if motion.beside is not None:
            masks.append(motion.beside)
        places = np.stack([known(motion.x), known(motion.y)], axis=-1)
        self.slots = here.slots(motion.pixels)
        self.moved = here.card.upload(places)
        self.masks = here.card.upload(np.concatenate([_words(x) for x in masks]))


def _words(mask: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Return the bits of a mask, 32 to a word."""
    packed = np.packbits(mask, bitorder="little")
    return np.pad(packed, (0, -len(packed) % 4)).view(np.uint32)
