"""Which pace a shot has."""

from __future__ import annotations

from typing import Any

from xrds_core.shot import Shot

from ...planning.request import Request
from ...planning.settings import Mode
from .deadline import Deadline, deadline
from .interface import Pace
from .same_picture import same_picture


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
