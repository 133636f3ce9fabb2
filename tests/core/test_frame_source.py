"""When the frames of a shot are loaded, completed, finished and dropped."""

from __future__ import annotations

import threading

import pytest
from frame_sources import Frames

from xrds_core.frame_source import FrameSource, Neighbourhood, Window, finish_frames
from xrds_core.shot import Shot


def test_frames_of_other_machines_are_neighbours_alone() -> None:
    shot = Shot((5, 6), radius=2, others=(1, 2, 3, 4, 7, 8, 9))
    loaded = []
    done = [x.number for x in Window(shot, Frames(lambda n: loaded.append(n) or n))]
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
    for found in Window(shot, Frames(load)):
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
    window = Window(shot, Frames(lambda n: None if n == 2 else n))
    found = [(x.number, x.own, x.neighbours) for x in window]
    assert found == [(1, 1, {}), (3, 3, {4: 4}), (4, 4, {3: 3})]
    assert window.neighbourhood(2) is None


def test_a_frame_is_finished_from_more_than_it_lends() -> None:
    class Completed(FrameSource[str]):
        def load(self, number: int) -> str:
            return f"{number}"

        def complete(self, frame: Neighbourhood[str]) -> tuple[str, str]:
            return f"{frame.own} whole", f"{frame.own} lent"

    window = Window(Shot((1, 2, 3), radius=1), Completed())
    assert [x.own for x in window] == ["1 whole", "2 whole", "3 whole"]
    window = Window(Shot((1, 2, 3), radius=1), Completed())
    assert [x.neighbours for x in window] == [
        {2: "2"},
        {1: "1 lent", 3: "3"},
        {2: "2 lent"},
    ]


def test_what_is_done_elsewhere_is_neither_completed_nor_finished() -> None:
    completed = []

    class Shared(FrameSource[int]):
        def load(self, number: int) -> int:
            return number

        def is_done(self, frame: Neighbourhood[int]) -> bool:
            return frame.number == 2

        def complete(self, frame: Neighbourhood[int]) -> tuple[int, int]:
            completed.append(frame.number)
            return frame.own, frame.own

    numbers = finish_frames(Shot((1, 2, 3), 1), Shared(), lambda frame: frame.number)
    assert list(numbers) == completed == [1, 3]


@pytest.mark.parametrize("beside", [False, True])
def test_frames_are_finished_in_order(beside: bool) -> None:
    shot, source = Shot((1, 2, 3), 1), Frames(lambda number: number)
    threads = []

    def finish(frame: Neighbourhood[int]) -> int:
        threads.append(threading.current_thread() is threading.main_thread())
        return frame.number

    assert list(finish_frames(shot, source, finish, beside=beside)) == [1, 2, 3]
    assert threads == [not beside] * 3
