"""No two frames that meet take the same samples."""

from __future__ import annotations

from itertools import combinations

import pytest
from shots import camera

from xrds_core.temporal.samples import Portion, portions

STILL = [camera()] * 12
MOVING = [camera(x=0.1 * k) for k in range(12)]
STOPS = [*MOVING[:5], *[MOVING[5]] * 6, *MOVING[6:]]


def taken(portion: Portion) -> set[tuple[int, int]]:
    first = portion.offset
    return {(portion.seed, x) for x in range(first, first + portion.length)}


@pytest.mark.parametrize("cameras", [STILL, MOVING, STOPS])
@pytest.mark.parametrize("radius", [0, 1, 4])
@pytest.mark.parametrize("seed", [0, 7, 2**31 - 1])
def test_no_two_frames_that_meet_take_the_same(cameras, radius, seed) -> None:  # noqa: ANN001
    parts = portions(cameras, 2, radius, seed)
    assert len(parts) == len(cameras)
    for one, two in combinations(range(len(parts)), 2):
        if two - one <= 2 * radius:  # both lend to a frame between them
            assert not taken(parts[one]) & taken(parts[two])
    for part in parts:
        assert part.length == 2
        assert 0 <= part.offset <= part.whole - part.length
        assert 0 <= part.seed < 2**31


def test_a_still_camera_continues_one_sequence() -> None:
    parts = portions(STILL, 4, 1, seed=3)
    assert [x.offset for x in parts[:4]] == [0, 4, 8, 0]
    assert {(x.seed, x.whole) for x in parts} == {(3, 12)}


def test_a_moving_camera_begins_a_sequence_in_every_frame() -> None:
    parts = portions(MOVING, 4, 1)
    assert {(x.offset, x.whole) for x in parts} == {(0, 4)}
    assert len({x.seed for x in parts}) == len(MOVING)


def test_a_camera_that_stops_does_both() -> None:
    whole = [x.whole for x in portions(STOPS, 1, 2)]
    assert whole == [1] * 5 + [5] * 6 + [1] * 6


def test_one_frame_is_a_still() -> None:
    assert portions([camera()], 8, 4, seed=5) == [Portion(6, 8, 0, 8)]
