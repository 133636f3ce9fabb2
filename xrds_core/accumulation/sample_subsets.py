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
    """A frame's part of a sample sequence: Cycles' *Sample Subset*.

    Cycles leaves passes made of sample 0 alone (Depth, Position, indices) empty where
    `offset` is not 0; `Denoising Depth` is filled. `use_sample_subset` is on unless the
    subset is the whole sequence.

    Attributes
    ----------
    seed : int
        Cycles' `seed`.
    whole : int
        Length of the sequence: Cycles' `samples`.
    offset : int
        First sample of the subset: Cycles' `sample_offset`.
    length : int
        Number of samples of the subset: Cycles' `sample_subset_length`.
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
    """Return the sample subset of a frame under a still camera.

    No other frame within `radius` has the same subset, if all take as many samples.

    Parameters
    ----------
    place : int
        The frame's index in the shot.
    samples : int
        Samples per pixel of this frame.
    radius : int
        Temporal radius, in frames.
    seed : int
        Seed of the sequence that the frames share.
    most : int
        Most samples that a frame of the shot may take, `samples` by default.

    Returns
    -------
    subset : SampleSubset
    """
    frames = 2 * radius + 1
    whole = max(samples, most) * frames
    return SampleSubset(seed % _SEEDS, whole, samples * (place % frames), samples)


def running_subset(begin: int, samples: int, most: int, seed: int = 0) -> SampleSubset:
    """Return the next samples of a long sequence.

    Frames that count samples on have none in common, however many each of them takes.
    The sequence begins anew after as many samples as `_LONG` frames of `most` take.

    Parameters
    ----------
    begin : int
        How many samples earlier frames have taken.
    samples : int
        Samples per pixel of this frame.
    most : int
        Most samples that a frame of the shot may take.
    seed : int
        Seed of the sequence that the frames share.

    Returns
    -------
    subset : SampleSubset
    """
    return SampleSubset(
        seed % _SEEDS, most * (_LONG + 1), begin % (most * _LONG), samples
    )
