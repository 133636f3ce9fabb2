"""What a shot is judged by: two raw renders of its middle frame and of the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..bench.windows import read_reference
from ..metrics import to_srgb
from .flicker import flicker
from .frames import MIDDLE, FrameRequest
from .rivals import cycles_oidn

if TYPE_CHECKING:
    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

    from .frames import ShotFrames

    Pair = tuple[Array, Array]
    Renders = tuple[tuple[Frame, Frame], tuple[Frame, Frame]]

_SEEDS = (101, 102)


def requests_of_truth(motion: str, samples: int) -> list[FrameRequest]:
    """The middle frame and the next, each with two seeds."""
    return [
        FrameRequest(motion, samples, number, seed=seed)
        for seed in _SEEDS
        for number in (MIDDLE, MIDDLE + 1)
    ]


@dataclass(frozen=True)
class Truth:
    """Two references of independent noise, and one without, each (H, W, 3) radiance.

    `pair` tells the squared error of a picture without the noise of either; where a
    scene has a reference of its own, both are that. `clean` is for what cannot be told
    from two. `renders` are the frame and the next of either seed.
    """

    pair: Pair
    clean: Array
    renders: Renders

    @classmethod
    def of(cls, frames: ShotFrames, motion: str, samples: int) -> Truth:
        """Read what `requests_of_truth` have rendered."""
        found = [frames.frame(x) for x in requests_of_truth(motion, samples)]
        renders = (found[0], found[1]), (found[2], found[3])
        if frames.shot.reference is not None:
            own = read_reference(frames.shot.reference)
            return cls((own, own), own, renders)
        return cls.of_renders(renders)

    @classmethod
    def of_renders(cls, renders: Renders) -> Truth:
        """Take two renders of a frame and the next, each of as many samples."""
        both = renders[0][0], renders[1][0]
        return cls(_radiance(*both), cycles_oidn(_mean_of(*both)), renders)

    def flicker(self, shown: Pair, stops: float) -> float:
        """Return that of radiance (H, W, 3) of both frames, seen at `stops`."""
        one, two = (_shown(_radiance(*pair), stops) for pair in self.renders)
        return flicker(_shown(shown, stops), (one, two), self.renders[0])


def _mean_of(one: Frame, two: Frame) -> Frame:
    """A frame of the samples of both, of which each has as many."""
    names = ("radiance", "albedo", "normal")
    means = {name: (getattr(one, name) + getattr(two, name)) / 2 for name in names}
    return replace(one, halves=None, **means)


def _radiance(one: Frame, two: Frame) -> Pair:
    assert one.radiance is not None
    assert two.radiance is not None
    return one.radiance, two.radiance


def _shown(pair: Pair, stops: float) -> Pair:
    return to_srgb(pair[0], stops), to_srgb(pair[1], stops)
