"""Which frames lend to which, and what they take of memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shots import HEIGHT, WIDTH, camera, view

from xrds_core.accumulation.frame import Halves, Stored, bytes_needed, store
from xrds_core.errors import UsageError
from xrds_core.shot import Shot


def test_neighbours_lie_on_both_sides_and_end_with_the_shot() -> None:
    shot = Shot(tuple(range(1, 8)), radius=2)
    assert shot.neighbours(4) == (3, 5, 2, 6)
    assert shot.neighbours(1) == (2, 3)
    assert shot.neighbours(7) == (6, 5)
    assert Shot((5,), radius=3).neighbours(5) == ()
    assert Shot((1, 2, 3), radius=0).neighbours(2) == ()


def test_steps_count_as_one_frame_each() -> None:
    assert Shot((1, 11, 21, 31), radius=1).neighbours(21) == (11, 31)


def test_no_frame_has_neighbours_across_a_cut() -> None:
    shot = Shot(tuple(range(1, 9)), radius=3, cuts=frozenset({4, 6}))
    assert shot.neighbours(3) == (2, 1)
    assert shot.neighbours(4) == (5,)
    assert shot.neighbours(6) == (7, 8)


def test_a_negative_radius_is_refused() -> None:
    with pytest.raises(UsageError, match="temporal radius -1: give 0 or more"):
        Shot((1, 2), radius=-1)


def taken(stored: Stored) -> int:
    """The bytes of all arrays of a frame."""
    parts = [
        *vars(stored).values(),
        *(vars(stored.noise) if stored.noise else {}).values(),
    ]
    return sum(x.nbytes for x in parts if isinstance(x, np.ndarray))


def test_memory_is_foretold() -> None:
    frame = view(0, camera()).frame
    frame = replace(frame, halves=Halves(np.stack((frame.radiance, frame.radiance))))
    assert taken(store(frame)) == bytes_needed(WIDTH, HEIGHT, 1)
    assert bytes_needed(1920, 1080, 9) < 530e6
    guides = store(replace(frame, radiance=None))
    assert taken(guides) == bytes_needed(WIDTH, HEIGHT, 1, light=False)
