"""Frames on a card: what its kernels read of them, kept while they lend samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..arrays import Array
    from ..temporal.frame import Stored
    from .card import Card

UNKNOWN = np.float32(-1e38)
"""What is NaN here, on a card."""
_LARGEST = np.float32(1e37)
_MEMORY = 2 << 30  # bytes of frames that are kept on a card


class FrameOnCard:
    """The buffers of a frame; those that it does not have are None.

    `counts` are samples per pixel, negative where the pixel is invalid. `parts` of its
    light are there once they were asked for.
    """

    def __init__(self, frame: Stored, card: Card) -> None:
        assert frame.noise is not None
        self.is_half = frame.picture.dtype == np.float16
        noise = np.stack([frame.noise.brightness, frame.noise.difference], axis=-1)
        counts = _counts(frame)
        arrays = {
            "picture": frame.picture,
            "noise": noise.astype(frame.picture.dtype, copy=False),
            "depth": known(frame.inverse_depth),
            "counts": counts,
        }
        given = {name: x for name, x in arrays.items() if x is not None}
        self.bytes = sum(x.nbytes for x in given.values())
        found = {name: card.upload(x) for name, x in given.items()}
        self.parts: dict[str, Any] = {}
        self.picture, self.noise = found["picture"], found["noise"]
        self.depth, self.counts = found["depth"], found.get("counts")


class FramesOnCard:
    """Uploads frames, and keeps them on a card as long as they exist and fit."""

    def __init__(self, card: Card) -> None:
        self.card = card
        self._known: WeakKeyDictionary[Stored, FrameOnCard] = WeakKeyDictionary()

    def of(self, frame: Stored) -> FrameOnCard:
        """The buffers of a frame, those used last kept longest."""
        found = self._known.pop(frame, None)
        if found is None:
            found = FrameOnCard(frame, self.card)
            self._make_room(found.bytes)
        self._known[frame] = found
        return found

    def part(self, frame: Stored, name: str) -> Any | None:
        """The buffer of a part of a frame's light; None where it is dark."""
        values = frame.parts[name]
        if values is None:
            return None
        found = self.of(frame)
        if name not in found.parts:
            found.parts[name] = self.card.upload(values)
            found.bytes += values.nbytes
            self._make_room(0, keep=frame)
        return found.parts[name]

    def clear(self) -> None:
        """Give their memory back."""
        self._known.clear()

    def _make_room(self, wanted: int, keep: Stored | None = None) -> None:
        kept = list(self._known.items())
        total = wanted + sum(each.bytes for _, each in kept)
        for frame, each in kept:
            if total <= _MEMORY:
                break
            if frame is not keep:
                del self._known[frame]
                total -= each.bytes


def known(x: Array) -> Array:
    """Return values without NaN and infinities, which kernels need not respect."""
    finite = np.clip(x, -_LARGEST, _LARGEST)
    return np.where(np.isnan(x), UNKNOWN, finite).astype(np.float32, copy=False)


def _counts(frame: Stored) -> NDArray[Any] | None:
    if frame.counts is None and frame.invalid is None:
        return None
    counts = np.full(frame.inverse_depth.shape, frame.samples, np.float32)
    if frame.counts is not None:
        counts[...] = frame.counts
    if frame.invalid is not None:
        counts[frame.invalid] = -1.0
    return counts
