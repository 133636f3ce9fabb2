"""Samples for a shot that is to be finished at a time.

Tries of the first frame, with more and more samples, tell what a sample takes, and the
first one what finishing does. From there on every frame corrects both, and the frames
that are left share the time that is left: so they are alike as long as they cost alike.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from xrds_core.errors import warn
from xrds_core.progress import duration
from xrds_core.shot import Shot

from ...planning.plan import DEADLINE, Decision
from ...planning.request import MOST_SAMPLES, Request
from ...planning.settings import counted
from ..methods import Finishing
from ..sampling import Sampled, can_continue
from .more import More

_FIRST_TRY, _GROWTH = 2, 4  # samples, and how many times those of the try before
# A further try may take this share of the time of all frames, or of one.
_OF_ALL, _OF_ONE = 0.02, 0.1
# Frames under a still camera continue one sequence: each has room for so many times
# the samples of the first.
_ROOM = 1.5
_ALIKE = 0.05  # a change of samples below this is not made
_NEWEST = 0.3  # weight of the newest frame in what is expected of the next


def _now() -> float:
    return time.perf_counter()


@dataclass
class Deadline:
    """Samples of the frames of a shot that ends `seconds` from now.

    `to_sample` frames are still to be sampled and `to_finish` to be finished, with up
    to `neighbours`; a frame counts once for each view layer. Where frames continue one
    sequence each has room for `room` samples.
    """

    seconds: float
    to_sample: int
    to_finish: int
    neighbours: int = 0
    continues: bool = False
    samples: int = 0
    room: int = 0
    _began: float = field(default_factory=_now)
    _try: int = _FIRST_TRY  # samples of the next one
    _tried_before: tuple[int, float] = (0, 0.0)  # samples and seconds
    _sync: float = 0.0  # seconds until Cycles has a frame's scene
    _start: float = 0.0  # seconds of a render beside that and its samples
    _sample: float = 0.0  # seconds of a sample
    _beside: float = 0.0  # seconds of a frame beside its render
    _measured: int = 0  # frames of which these are known
    _completed: float | None = None  # when the last frame was
    _rendered: float = 0.0  # seconds of renders since then
    _is_late: bool = False  # and that was said
    prepares: ClassVar[bool] = False

    def request(self, request: Request, number: int) -> Request:
        """The request of the next frame that is sampled, whatever its number."""
        if not self.samples:
            return request.with_settings(samples=self._try)
        if self.continues:
            share = self.samples / self.room
            return request.with_settings(samples=self.room, share=share)
        return request.with_settings(samples=self.samples)

    def takes(self, method: Finishing, frame: Sampled) -> bool:
        """Note a frame that was sampled; False where that was to find out alone."""
        seconds, sync = (frame.seconds.get(x, 0.0) for x in ("beauty", "sync"))
        if not self.samples:
            self._tried(method, frame, seconds)
            return False
        self.to_sample -= 1
        self._rendered += sync + seconds
        # the scene of the tries is there already; from then on it is another frame's
        first = not self._sync
        self._sync += (1.0 if first else _NEWEST) * (sync - self._sync)
        # one that is quicker than its start is a change of scene like any other
        sample = max(seconds - self._start, 0.1 * seconds) / self.samples
        self._sample += _NEWEST * (sample - self._sample)
        self._choose()
        return True

    def prepare(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled]
    ) -> None:
        """Nothing: a frame is not judged."""

    def complete(
        self,
        method: Finishing,
        own: Sampled,
        others: Sequence[Sampled],
        more: More,
        prepared: None,
    ) -> Sampled:
        """The frame as it is, with why it has its samples."""
        now = _now()
        if self._completed is not None:
            beside = max(now - self._completed - self._rendered, 0.0)
            self._measured += 1
            newest = max(_NEWEST, 1.0 / self._measured)
            self._beside += newest * (beside - self._beside)
        self._completed, self._rendered = now, 0.0
        left = duration(max(self._left, 0.0))
        reason = f"{left} were left for {counted(self.to_finish, 'frame')}"
        value = counted(own.samples or self.samples, "sample")
        decided = Decision(DEADLINE, value, reason)
        self.to_finish -= 1
        self._choose()
        return replace(own, decisions=(decided,), share=1.0)

    @property
    def _left(self) -> float:
        return self.seconds - (_now() - self._began)

    def _tried(self, method: Finishing, frame: Sampled, seconds: float) -> None:
        """Learn from a try; choose once there are enough of them."""
        if self._try == _FIRST_TRY:
            for view in frame.views:
                picture = method.finish(frame, [frame] * self.neighbours, view)
                self._beside += sum(picture.seconds.values())
                if self.neighbours:  # most frames are denoised without them as well
                    self._beside += picture.seconds["denoise"]
        few, least = self._tried_before
        self._tried_before = many, most = self._try, seconds
        self._sample = max((most - least) / (many - few), 0.1 * most / many)
        self._start = max(most - many * self._sample, 0.0)
        self._try *= _GROWTH
        allowed = max(_OF_ALL, _OF_ONE / self.to_finish) * self._left
        if most * _GROWTH > allowed or self._try > MOST_SAMPLES:
            self._take(self._wanted())

    def _wanted(self) -> float:
        """Samples that spend the time that is left, if all frames take as many."""
        left = self._left - self.to_finish * self._beside
        left -= self.to_sample * (self._sync + self._start)
        return left / max(self.to_sample * self._sample, 1e-9)

    def _choose(self) -> None:
        """Change the samples of the frames to come if the time left says so."""
        if not self.to_sample:
            return
        wanted = self._wanted()
        if abs(wanted - self.samples) > max(_ALIKE * self.samples, 0.5):
            self._take(wanted)

    def _take(self, wanted: float) -> None:
        if wanted < 1.0 and not self._is_late:
            self._is_late = True
            seconds = self._beside + self._sync + self._start + self._sample
            needed = duration(self.to_finish * seconds)
            warn(
                "the deadline leaves less than one sample for a frame; with one, "
                f"{counted(self.to_finish, 'frame')} take about {needed}"
            )
        self.samples = int(min(max(round(wanted), 1), MOST_SAMPLES))
        if self.samples > self.room:
            self.room = min(round(_ROOM * self.samples), MOST_SAMPLES)


def deadline(scene: Any, request: Request, shot: Shot, layers: int = 1) -> Deadline:
    """What chooses the samples of a shot that has a deadline, for all its layers."""
    assert request.deadline is not None
    sampled = set(shot.frames)
    for number in shot.frames:
        sampled.update(shot.neighbours(number))
    return Deadline(
        request.deadline,
        to_sample=layers * len(sampled),
        to_finish=layers * len(shot.frames),
        neighbours=2 * shot.radius,
        continues=bool(request.settings.temporal_radius)
        and can_continue(scene, request.with_settings(samples=1)),
    )
