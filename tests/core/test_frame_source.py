"""When the frames of a shot are loaded, completed, finished and dropped."""

from __future__ import annotations

import threading

import pytest
from frame_sources import Frames

from xrds_core.frame_source import FrameSource, Neighbourhood, Window, finish_frames
from xrds_core.overlap import Overlap
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

        def complete(self, frame: Neighbourhood[str], _: None) -> tuple[str, str]:
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

        def complete(self, frame: Neighbourhood[int], _: None) -> tuple[int, int]:
            completed.append(frame.number)
            return frame.own, frame.own

    numbers = finish_frames(Shot((1, 2, 3), 1), Shared(), lambda frame: frame.number)
    assert list(numbers) == completed == [1, 3]


class Judged(FrameSource[str]):
    """Frames that are judged with what their neighbours lend."""

    def __init__(self) -> None:
        self.loaded: list[int] = []
        self.may_prepare = threading.Event()
        self.most = 0  # frames loaded beyond the neighbours of one that is prepared

    @property
    def prepares(self) -> bool:
        return True

    def load(self, number: int) -> str:
        self.loaded.append(number)
        self.may_prepare.set()  # the next one is loaded while this is waited for
        return str(number)

    def prepare(self, frame: Neighbourhood[str]) -> str:
        if threading.current_thread() is not threading.main_thread():
            last = max((frame.number, *frame.neighbours))
            if last < LAST:
                assert self.may_prepare.wait(10.0)
            self.most = max(self.most, max(self.loaded) - last)
        return " ".join(frame.neighbours.values())

    def complete(self, frame: Neighbourhood[str], prepared: str) -> tuple[str, str]:
        self.may_prepare.clear()
        return f"{frame.own} of {prepared}", f"{frame.own}+"


LAST = 6


@pytest.mark.parametrize("radius", [0, 1, 2])
def test_a_frame_is_prepared_beside_the_loading_of_the_next(radius: int) -> None:
    """With what the frames before it lend, and none further ahead."""
    shot = Shot(tuple(range(1, LAST + 1)), radius)
    made = []
    for beside in (False, True):
        source = Judged()
        made.append(list(finish_frames(shot, source, lambda x: x.own, beside=beside)))
        assert source.loaded == list(shot.frames)
        assert source.most == int(beside)
    assert made[0] == made[1]
    if radius == 1:
        assert made[0][:2] == ["1 of 2", "2 of 1+ 3"]


def test_a_frame_that_was_prepared_is_completed_when_it_is_asked_for() -> None:
    source = Judged()
    window = Window(Shot((1, 2, 3, 4), 1), source)
    assert window.neighbourhood(1).own == "1 of 2"
    with Overlap(True) as overlap:
        window.load(3)
        window.prepare(2, overlap)
        window.load(4)
    assert source.loaded == [1, 2, 3, 4]
    assert window.neighbourhood(2).own == "2 of 1+ 3"
    with Overlap(True) as overlap:
        window.prepare(3, overlap)
    found = window.neighbourhood(4)  # 3 is not asked for
    assert (found.own, found.neighbours) == ("4 of 3", {3: "3"})


@pytest.mark.parametrize("beside", [False, True])
def test_frames_are_finished_in_order(beside: bool) -> None:
    shot, source = Shot((1, 2, 3), 1), Frames(lambda number: number)
    threads = []

    def finish(frame: Neighbourhood[int]) -> int:
        threads.append(threading.current_thread() is threading.main_thread())
        return frame.number

    assert list(finish_frames(shot, source, finish, beside=beside)) == [1, 2, 3]
    assert threads == [not beside] * 3
