"""The history of a shot whose camera stands still: frames that have left its window.

There every pixel shows the same surface for as long as nothing moves in front of it, so
frames older than the temporal radius are still useful. They are stored as one frame,
the mean of their samples. A frame joins it in the way it reuses neighbours itself:
where it shows something else, or other light, the pixel's history begins anew.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..accumulation.accumulate import accumulate, sample_counts
from ..accumulation.frame import pack, pack_counts, pack_parts
from ..accumulation.object_motion import Movement
from ..arrays import floats

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..accumulation.frame import Stored


LONGEST = 32
"""Frames that a history counts as at most: older ones fade, as light drifts."""


class History:
    """What is left of the frames before those in a window, by view."""

    def __init__(self) -> None:
        self._movement = Movement()
        self._window: dict[int, Mapping[str, Stored]] = {}
        self.views: dict[str, Stored] = {}

    @property
    def number(self) -> int:
        """Number of its newest frame."""
        return next(iter(self.views.values())).number

    def advance(self, window: Mapping[int, Mapping[str, Stored]]) -> None:
        """Add the frames that have left the window to the history.

        Parameters
        ----------
        window : mapping of int to mapping of str to Stored
            Frames of the new window by number, their views by name.
        """
        first = min(window)
        for number in sorted(n for n in self._window if n < first):
            for view, frame in self._window[number].items():
                older = self.views.get(view)
                self.views[view] = extended(older, frame, self._movement)
        self._window = dict(window)


def extended(history: Stored | None, frame: Stored, movement: Movement) -> Stored:
    """Add the samples of a frame to the history before it.

    Parameters
    ----------
    history : Stored or None
        The history of a view; None where it begins.
    frame : Stored
        A later frame.
    movement : Movement
        Cache of the shot's object motion.

    Returns
    -------
    history : Stored
        The mean of the samples of both, with the frame's number.
    """
    if history is None:
        return frame
    accumulated = accumulate(frame, [history], movement)
    own = sample_counts(frame)
    total = accumulated.samples.ravel()
    counts = np.minimum(total, own * LONGEST)
    passes = (
        accumulated.radiance,
        accumulated.albedo,
        accumulated.normal,
        accumulated.alpha,
    )
    picture, invalid = pack(*passes)
    share = np.where(total > 0.0, own / np.maximum(total, 1e-9), 1.0)
    noise = frame.noise
    if noise is not None and history.noise is not None:
        noise = noise.within(share, floats(history.noise.brightness))
    return replace(
        frame,
        samples=max(float(counts.mean()), 1e-9),
        counts=pack_counts(counts),
        picture=picture,
        invalid=invalid if invalid.any() else None,
        noise=noise,
        parts=pack_parts(accumulated.parts),
    )
