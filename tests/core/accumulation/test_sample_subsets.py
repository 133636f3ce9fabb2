"""No two frames that meet take the same samples."""

from __future__ import annotations

from itertools import combinations, pairwise

import pytest

from xrds_core.accumulation.sample_subsets import (
    SampleSubset,
    consecutive_subset,
    running_subset,
)

FRAMES = range(12)


def taken(subset: SampleSubset) -> set[tuple[int, int]]:
    first = subset.offset
    return {(subset.seed, x) for x in range(first, first + subset.length)}


@pytest.mark.parametrize("radius", [0, 1, 4])
@pytest.mark.parametrize("seed", [0, 7, 2**31 - 1])
def test_no_two_frames_that_meet_take_the_same(radius: int, seed: int) -> None:
    parts = [consecutive_subset(place, 2, radius, seed) for place in FRAMES]
    for one, two in combinations(FRAMES, 2):
        if two - one <= 2 * radius:  # both lend to a frame between them
            assert not taken(parts[one]) & taken(parts[two])
    for part in parts:
        assert part.length == 2
        assert 0 <= part.offset <= part.whole - part.length
        assert 0 <= part.seed < 2**31


def test_frames_that_count_on_take_what_nobody_else_takes() -> None:
    most, counts, begin, every = 16, [16, 3, 7, 1, 16, 2] * 12, 0, []
    for count in counts:
        every.append(running_subset(begin, count, most, seed=3))
        begin += count
    assert len(set().union(*map(taken, every))) == sum(counts)
    assert len({(x.seed, x.whole) for x in every}) == 1
    assert all(x.offset + x.length <= x.whole for x in every)
    for one, two in pairwise(every):  # side by side: together they are a sequence
        assert two.offset == one.offset + one.length
    late = running_subset(1_000_000, most, most)
    assert late.offset + late.length <= late.whole


def test_a_still_camera_continues_one_sequence() -> None:
    parts = [consecutive_subset(place, 4, 1, seed=3) for place in FRAMES]
    assert [x.offset for x in parts[:4]] == [0, 4, 8, 0]
    assert {(x.seed, x.whole) for x in parts} == {(3, 12)}


@pytest.mark.parametrize("length", [2, 5, 64])
@pytest.mark.parametrize("seed", [0, 7, 2**31 - 1])
def test_sequences_of_their_own_are_as_long_as_the_halves(
    length: int, seed: int
) -> None:
    subset = SampleSubset(seed, length, 0, length)
    sequences = subset.sequences()
    for one, half in zip(sequences, subset.halves(), strict=True):
        assert one.whole == one.length == half.length
        assert one.offset == 0
        assert 0 <= one.seed < 2**31
    assert not taken(sequences[0]) & taken(sequences[1])
