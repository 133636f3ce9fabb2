"""Work beside other work: in order, with its errors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from xrds_core.overlap import Overlap


def pieces() -> Iterator[Callable[[], int]]:
    for number in range(4):
        yield lambda number=number: number


@pytest.mark.parametrize("is_on", [False, True])
def test_pieces_come_in_order(is_on: bool) -> None:
    found = []
    with Overlap[int](is_on) as overlap:
        for work in pieces():
            found += overlap.put(work)
        found += overlap.rest()
    assert found == [0, 1, 2, 3]


def test_one_piece_runs_beside_what_goes_on_here() -> None:
    """Each piece ends only after something was done here; in turn none would."""
    with Overlap[bool](True) as overlap:
        for _ in range(4):
            sampled = threading.Event()
            assert all(overlap.put(lambda event=sampled: event.wait(600)))
            sampled.set()
        assert all(overlap.rest())


def test_other_work_runs_beside_a_piece() -> None:
    both = threading.Barrier(2)
    with Overlap[int](True) as overlap:
        for _ in range(3):
            list(overlap.put(lambda: both.wait(600)))
            found = overlap.begin(lambda: both.wait(600))
        assert {found(), *overlap.rest()} == {0, 1}
    made: list[int] = []
    with Overlap[int](False) as overlap:
        work = overlap.begin(lambda: made.append(1))
        assert made == []
        work()
    assert made == [1]


def test_the_next_piece_has_begun_when_a_result_is_taken() -> None:
    begun = threading.Event()
    with Overlap[bool](True) as overlap:
        assert list(overlap.put(lambda: True)) == []
        for _ in overlap.put(lambda: begun.set() or True):
            assert begun.wait(600)
        assert list(overlap.rest()) == [True]


def test_an_error_of_a_piece_reaches_the_one_who_takes_it() -> None:
    def fail() -> int:
        raise RuntimeError("no memory")

    with Overlap[int](True) as overlap:
        assert list(overlap.put(fail)) == []
        with pytest.raises(RuntimeError, match="no memory"):
            list(overlap.rest())


def test_an_error_here_waits_for_nothing() -> None:
    may_end, ended = threading.Event(), threading.Event()
    overlap = Overlap[None](True)
    list(overlap.put(lambda: may_end.wait(600) and ended.set()))
    overlap.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert not ended.is_set()
    may_end.set()
