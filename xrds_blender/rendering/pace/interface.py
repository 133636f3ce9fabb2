"""What a pace is to those who render frames, and they to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from xrds_core.accumulation.accumulate import Accumulated
from xrds_core.arrays import Array

from ...planning.request import Request
from ..picture import Picture
from ..sampling import Sampled
from .more import More


class Finishing(Protocol):
    """What makes pictures of frames: `FullSize`."""

    def accumulate(
        self, own: Sampled, others: Sequence[Sampled], view: str
    ) -> Accumulated:
        """One view with the samples of its neighbours."""

    def finish(self, own: Sampled, others: Sequence[Sampled], view: str) -> Picture:
        """The picture of one view."""

    def radiance(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        region: tuple[slice, slice],
    ) -> Array:
        """Rows and columns of the picture of one view, (H, W, 3), denoised alone."""

    def denoised(self, radiance: Array, albedo: Array, normal: Array) -> Array:
        """Samples by themselves, denoised."""


class Pace(Protocol):
    """What chooses the samples of each frame of one shot, in the order of time."""

    def request(self, request: Request) -> Request:
        """The request of the next frame that is sampled."""

    def takes(self, method: Finishing, frame: Sampled) -> bool:
        """Note a frame that was sampled; False where it is to be sampled again."""

    def complete(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled], more: More
    ) -> Sampled:
        """A frame with all that it is finished from; `more` renders more samples.

        Raises Cancelled when the user stops their render.
        """
