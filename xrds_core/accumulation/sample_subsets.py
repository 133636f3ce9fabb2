"""Sample subsets: which samples each frame renders, so that neighbours share none.

Where the camera stands still the frames share one sample sequence and each renders the
next subset of it: the mean of nine such frames is one render with nine times the
samples, and 2 to 3 dB better than nine renders with different seeds. Where the camera
moves each frame has its own seed and starts its own sequence: subsets that begin later
are worse by themselves, and gain nothing there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

_SEEDS = 2**31  # Cycles takes a signed 32-bit integer
_LONG = 64  # frames
_APART = 32_452_843  # of seeds: a prime that nothing else sets seeds apart by


@dataclass(frozen=True)
class SampleSubset:
    """A frame's subset of a sample sequence, as Cycles' *Sample Subset*.

    In Cycles: `seed`; `whole` is `samples`, `offset` is `sample_offset` and `length`
    is `sample_subset_length`, with `use_sample_subset` on unless the subset is the
    whole sequence. Passes made of sample 0 alone (Depth, Position, indices) are empty
    where `offset` is not 0; `Denoising Depth` is not.
    """

    seed: int
    whole: int
    offset: int
    length: int

    def halves(self) -> tuple[SampleSubset, SampleSubset]:
        """Return the first and the second half, of two samples or more."""
        first = self.length - self.length // 2
        second = replace(self, offset=self.offset + first, length=self.length - first)
        return replace(self, length=first), second

    def sequences(self) -> tuple[SampleSubset, SampleSubset]:
        """Return two sequences as long as the halves, each with a seed of its own."""
        first, second = (half.length for half in self.halves())
        other = (self.seed + _APART) % _SEEDS
        return (
            SampleSubset(self.seed, first, 0, first),
            SampleSubset(other, second, 0, second),
        )

    def shares(self) -> tuple[float, float]:
        """Return the share of the samples that each half has."""
        first, second = self.halves()
        return first.length / self.length, second.length / self.length


def consecutive_subset(
    place: int, samples: int, radius: int, seed: int = 0, most: int = 0
) -> SampleSubset:
    """Return the subset of a frame under a still camera.

    No other frame within `radius` has it, if all take as many samples. `place` is the
    frame's index in the shot; `most` are the samples that a frame may take, `samples`
    by default.
    """
    frames = 2 * radius + 1
    whole = max(samples, most) * frames
    return SampleSubset(seed % _SEEDS, whole, samples * (place % frames), samples)


def running_subset(begin: int, samples: int, most: int, seed: int = 0) -> SampleSubset:
    """Return the samples of a long sequence from `begin` on, the number taken so far.

    Frames that count samples on have none in common, however many each takes, up to
    `most`; after as many as `_LONG` such frames take the sequence begins anew.
    """
    return SampleSubset(
        seed % _SEEDS, most * (_LONG + 1), begin % (most * _LONG), samples
    )
