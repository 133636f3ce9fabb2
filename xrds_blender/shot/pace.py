"""How many samples the frames of a shot take, where that is found as they render."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from xrds_core.temporal.window import Shot

from ..planning.request import Request
from ..planning.settings import Mode
from .deadline import Deadline, deadline
from .same_picture import Finishing, More, same_picture
from .sampling import Sampled


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


def pace_of(
    scene: Any,
    request: Request,
    shot: Shot,
    *,
    layers: int = 1,
    beside: Pace | None = None,
) -> Pace | None:
    """What chooses the samples of a shot; None where frames have those requested.

    Where several view `layers` render in turn, `beside` is that of another one: they
    share a deadline.
    """
    if request.deadline is not None and request.settings.mode is Mode.FULL_SIZE:
        if isinstance(beside, Deadline):
            return beside
        return deadline(scene, request, shot, layers)
    return same_picture(scene, request, len(shot.order))
