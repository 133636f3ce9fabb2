"""Which samples each frame takes, so that no two frames that meet take the same ones.

Where the camera stands still the frames share one sequence and each takes its next
part: the mean of nine such frames is one render with nine times the samples, and 2 to 3
dB better than nine renders with seeds of their own. Where the camera moves each frame
has its own seed and begins its sequence: parts that begin later are worse by themselves
and gain nothing there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

_SEEDS = 2**31  # Cycles takes a signed 32-bit integer


@dataclass(frozen=True)
class Portion:
    """A frame's part of a sample sequence.

    In Cycles: `seed`; `whole` is `samples`, `offset` is `sample_offset` and
    `length` is `sample_subset_length`, with `use_sample_subset` on where the part is
    not the whole. Passes of sample 0 alone (Depth, Position, indices) are empty where
    `offset` is not 0; `Denoising Depth` is not.
    """

    seed: int
    whole: int
    offset: int
    length: int

    def halves(self) -> tuple[Portion, Portion]:
        """Return the first and the second half, of two samples or more."""
        first = self.length - self.length // 2
        second = replace(self, offset=self.offset + first, length=self.length - first)
        return replace(self, length=first), second

    def shares(self) -> tuple[float, float]:
        """Return what share of the samples each half has."""
        first, second = self.halves()
        return first.length / self.length, second.length / self.length


def continued(place: int, samples: int, radius: int, seed: int = 0) -> Portion:
    """Return the part of one frame of a still run: no other within `radius` takes it.

    `place` is the frame's in the shot.
    """
    frames = 2 * radius + 1
    offset = samples * (place % frames)
    return Portion(seed % _SEEDS, samples * frames, offset, samples)
