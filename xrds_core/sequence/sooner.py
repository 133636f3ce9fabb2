"""Whether frames of fewer samples are done sooner than Cycles would do all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..notices import warn

_FRAMES = 5  # that are timed before anything is said
_LATER = 1.1  # times Cycles' seconds, from which it is said


@dataclass
class Clock:
    """Seconds of the frames of a shot, and what Cycles alone would take for them.

    Cycles' denoiser takes about as long as ours for one picture: `denoising`.
    """

    denoising: float = 0.0
    _last: float | None = None
    _ours: list[float] = field(default_factory=list)
    _theirs: list[float] = field(default_factory=list)
    _is_said: bool = False

    def leave_out(self, now: float) -> None:
        """A frame was measured in, which takes longer than others.

        Those before it had other samples than those that come, often more.
        """
        self._last = now
        self._ours.clear()
        self._theirs.clear()

    def add(self, now: float, seconds: Mapping[str, float], share: float) -> None:
        """Note a frame that took `seconds` by stage for a `share` of all samples.

        One line is printed where frames take longer than Cycles would.
        """
        if self._last is not None:
            sampling = seconds.get("beauty", 0.0) / share
            self._ours.append(now - self._last)
            self._theirs.append(seconds.get("sync", 0.0) + sampling + self.denoising)
        self._last = now
        ours, theirs = sum(self._ours), sum(self._theirs)
        count = len(self._ours)
        if count >= _FRAMES and ours > _LATER * theirs and not self._is_said:
            self._is_said = True
            warn(
                f"Same Picture takes {ours / count:.3g} s a frame here, Cycles with "
                f"its denoiser about {theirs / count:.3g} s: --plain is sooner, "
                "and without Same Picture the picture is better"
            )
