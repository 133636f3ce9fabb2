"""Which frames lend to which, and when they are loaded and dropped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shots import HEIGHT, WIDTH, camera, view

from xrds_core.accumulation.frame import Halves, Stored, store
from xrds_core.errors import UsageError
from xrds_core.shot import Shot, Window, bytes_needed


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


def test_frames_of_other_machines_are_neighbours_alone() -> None:
    shot = Shot((5, 6), radius=2, others=(1, 2, 3, 4, 7, 8, 9))
    loaded = []
    done = [x.number for x in Window(shot, lambda n: loaded.append(n) or n)]
    assert done == [5, 6]
    assert loaded == [3, 4, 5, 6, 7, 8]  # and no frame that nobody needs


@pytest.mark.parametrize("radius", [0, 1, 3, 20])
@pytest.mark.parametrize("cuts", [(), (5, 9)])
def test_each_frame_is_loaded_once_and_few_are_kept(
    radius: int, cuts: tuple[int, ...]
) -> None:
    shot = Shot(tuple(range(12)), radius, frozenset(cuts))
    alive: dict[int, int] = {}
    loads: list[int] = []
    most = 0

    class Picture:
        def __init__(self, number: int) -> None:
            self.number = number
            alive[number] = 1

        def __del__(self) -> None:
            del alive[self.number]

    def load(number: int) -> Picture:
        loads.append(number)
        return Picture(number)

    done = []
    for found in Window(shot, load):
        number = found.number
        assert found.own.number == number
        assert tuple(found.neighbours) == shot.neighbours(number)
        assert all(x.number == n for n, x in found.neighbours.items())
        done.append(number)
        most = max(most, len(alive))
        # no later than it must be: the last neighbour is there, and nothing beyond
        assert max(loads) == max((number, *found.neighbours))
        del found
    assert done == loads == list(range(12))
    assert most <= min(2 * radius + 1, len(shot.order))


def test_missing_frames_are_left_out_and_nobodys_neighbours() -> None:
    shot = Shot((1, 2, 3, 4), radius=1)
    window = Window(shot, lambda n: None if n == 2 else n)
    found = [(x.number, x.own, x.neighbours) for x in window]
    assert found == [(1, 1, {}), (3, 3, {4: 4}), (4, 4, {3: 3})]
    assert window.neighbourhood(2) is None


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
    parts = (np.stack((x, x)) for x in (frame.radiance, frame.albedo, frame.normal))
    frame = replace(frame, halves=Halves(*parts))
    assert taken(store(frame)) == bytes_needed(WIDTH, HEIGHT, 1)
    assert bytes_needed(1920, 1080, 9) < 530e6
    guides = store(replace(frame, radiance=None))
    assert taken(guides) == bytes_needed(WIDTH, HEIGHT, 1, light=False)
