"""What an animation takes in Cycles and in XRDS: each frame, and all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from xrds_core.time_left import duration

from ...choosing import history
from ...choosing.modes import frame_seconds
from ...planning.estimates import Capabilities, Estimate, resolved
from ...planning.request import Request
from ...planning.settings import Mode
from ...scene.contents import frame_range
from ...shot.pace.same_picture import can_save
from ...shot.sampling import has_neighbours
from . import paragraph, words
from .paragraph import translated

UNKNOWN = "Known after a first render of a frame"
EXPECTED = "Expected from the renders of this file so far"
ALONE = (
    "Frames of this camera, or without a temporal radius, cannot use each other's "
    "samples: each is rendered by itself"
)
STILLS = "Frames help each other in animations, not in single images"


@dataclass(frozen=True)
class Expected:
    """An animation before it is rendered.

    `cycles` and `ours` are the seconds of a frame, None where nothing is known; the
    latter are `at_most` so many where samples are saved. `picture` is ours beside that
    of Cycles. `is_shot` tells whether frames use each other's samples.
    """

    frames: int
    cycles: float | None
    ours: float | None
    picture: str
    at_most: bool = False
    is_shot: bool = True


def expected(
    scene: Any,
    request: Request,
    here: Capabilities,
    estimated: Sequence[Estimate],
) -> Expected:
    """What to expect of the scene's range, in modes as `estimated` for a shot."""
    frames = len(frame_range(scene))
    is_shot = has_neighbours(scene, request)
    known = history.scene_settings(scene)
    settings = request.settings
    cycles = resolved(replace(settings, mode=Mode.CYCLES_ONLY, denoising=None), known)
    saves = can_save(scene, request, frames)
    radius = settings.temporal_radius if is_shot else 0
    ours = frame_seconds(scene, resolved(settings, known), radius)
    if request.deadline is not None:
        ours = request.deadline / frames
    picture = words.of(settings.mode, estimated, scene, here)
    return Expected(
        frames,
        history.seconds(scene, cycles),
        ours,
        translated("same") if saves else picture,
        saves,
        is_shot,
    )


def draw(layout: Any, context: Any, found: Expected) -> None:
    """Draw what it takes in Cycles and in XRDS, and where that is from."""
    column = layout.column(align=True)
    title = translated("Animation, {count} frames", count=found.frames)
    column.label(text=title, translate=False)
    limit = "≤ " if found.at_most else ""
    rows = [
        ("Cycles", _both(found.cycles, found.frames)),
        ("XRDS", _both(found.ours, found.frames, limit)),
        (translated("Picture"), found.picture),
    ]
    for name, value in rows:
        split = column.split(factor=0.3)
        split.label(text=name, translate=False)
        split.label(text=value, translate=False)
    known = None not in (found.cycles, found.ours)
    notes = [EXPECTED if known else UNKNOWN, STILLS if found.is_shot else ALONE]
    for note in notes:
        paragraph.draw(layout, context, translated(note))


def _both(seconds: float | None, frames: int, limit: str = "") -> str:
    """The time of all frames, and of one."""
    if seconds is None:
        return "?"
    whole, each = limit + duration(seconds * frames), duration(seconds)
    return translated("{whole}, a frame {each}", whole=whole, each=each)
