"""No two frames that meet take the same samples."""

from __future__ import annotations

from itertools import combinations

import pytest

from xrds_core.temporal.sample_subsets import (
    SampleSubset,
    consecutive_subset,
    further_subset,
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


def test_further_samples_are_nobody_elses() -> None:
    radius, most, few = 1, 16, 4
    parts = [consecutive_subset(place, few, radius, 3, most) for place in range(3)]
    more = [further_subset(part, radius, most - few) for part in parts]
    assert {x.whole for x in (*parts, *more)} == {most * 3}
    every = [taken(x) for x in (*parts, *more)]
    assert len(set().union(*every)) == sum(map(len, every)) == most * 3
    # those that all frames have lie side by side: together they are a sequence
    assert set().union(*every[:3]) == {(3, n) for n in range(3 * few)}


def test_a_still_camera_continues_one_sequence() -> None:
    parts = [consecutive_subset(place, 4, 1, seed=3) for place in FRAMES]
    assert [x.offset for x in parts[:4]] == [0, 4, 8, 0]
    assert {(x.seed, x.whole) for x in parts} == {(3, 12)}
