"""Whether fewer samples are sooner: a shot's frames beside what Cycles would take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

_RENDERS = 2  # in which a frame is sampled, half of its samples each
_FRAMES = 5  # that are timed before anything is said
LEAST = 0.1
"""Share of Cycles' seconds that has to be saved: else a better picture is worth more.
"""


@dataclass
class Savings:
    """Seconds of the frames of a shot, and what Cycles with its denoiser would take.

    Attributes
    ----------
    samples : int
        Samples of the file's frames.
    denoising : float
        Seconds that Cycles' denoiser takes for one picture.
    one : float or None
        Seconds of a render of one sample; None as long as that is not known.
    """

    samples: int
    denoising: float = 0.0
    one: float | None = None
    _last: float | None = None
    _ours: list[float] = field(default_factory=list)
    _theirs: list[float] = field(default_factory=list)

    def leave_out(self, now: float) -> None:
        """Leave out a frame that was measured in, which takes longer than others.

        Those before it had other samples than those that come, often more.
        """
        self._last = now
        self._ours.clear()
        self._theirs.clear()

    def add(self, now: float, seconds: Mapping[str, float], share: float) -> None:
        """Note a frame.

        Parameters
        ----------
        now : float
            The time, in seconds.
        seconds : mapping of str to float
            What the frame took, by stage.
        share : float
            Share of all samples that it was rendered with.
        """
        if self._last is not None:
            sampling = self._of_all(seconds.get("beauty", 0.0), share)
            self._ours.append(now - self._last)
            self._theirs.append(seconds.get("sync", 0.0) + sampling + self.denoising)
        self._last = now

    def _of_all(self, seconds: float, share: float) -> float:
        """Return the seconds of a render of all samples, by those of a share.

        On a card most of a render of few samples is not spent on samples.
        """
        most, count = seconds / share, share * self.samples
        if self.one is None or count <= _RENDERS:
            return most
        sample = (seconds - _RENDERS * self.one) / (count - _RENDERS)
        return min(self.one + max(sample, 0.0) * (self.samples - 1), most)

    @property
    def are_known(self) -> bool:
        """Whether enough frames were timed."""
        return len(self._ours) >= _FRAMES

    @property
    def seconds(self) -> tuple[float, float]:
        """Seconds of a frame here, and about what Cycles with its denoiser takes.

        Medians: a machine that stood still in one of the frames does not decide.
        """
        return median(self._ours or [0.0]), median(self._theirs or [0.0])

    @property
    def are_enough(self) -> bool:
        """Whether at least `LEAST` of Cycles' seconds are saved."""
        ours, theirs = self.seconds
        return ours <= (1.0 - LEAST) * theirs
