"""Frames finished while the next ones are sampled: the same pictures, sooner."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from xrds_blender.planning.request import render_request
from xrds_blender.shot import shot as shots
from xrds_blender.shot.full_size import FullSize
from xrds_blender.shot.overlap import Overlap, samples_on_card

FRAMES = range(1, 6)


def pieces(done: list[int], pause: float = 0.0) -> Iterator[Callable[[], int]]:
    for number in range(4):

        def work(number: int = number) -> int:
            time.sleep(pause)
            done.append(number)
            return number

        yield work


@pytest.mark.parametrize("is_on", [False, True])
def test_pieces_come_in_order(is_on: bool) -> None:
    found = []
    with Overlap[int](is_on) as overlap:
        for work in pieces([]):
            found += overlap.put(work)
        found += overlap.rest()
    assert found == [0, 1, 2, 3]


def test_one_piece_runs_beside_what_goes_on_here() -> None:
    started = time.perf_counter()
    with Overlap[int](True) as overlap:
        for work in pieces([], pause=0.2):
            list(overlap.put(work))
            time.sleep(0.2)  # sampling the next frame
        list(overlap.rest())
    assert time.perf_counter() - started < 1.3  # 1.6 in turn


def test_an_error_of_a_piece_reaches_the_one_who_takes_it() -> None:
    def fail() -> int:
        raise RuntimeError("no memory")

    with Overlap[int](True) as overlap:
        assert list(overlap.put(fail)) == []
        with pytest.raises(RuntimeError, match="no memory"):
            list(overlap.rest())


def test_an_error_here_waits_for_nothing() -> None:
    may_end = threading.Event()
    started = time.perf_counter()
    overlap = Overlap[bool](True)
    list(overlap.put(lambda: may_end.wait(20)))
    overlap.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert time.perf_counter() - started < 5.0
    may_end.set()


def test_without_a_card_nothing_overlaps(life: Any) -> None:
    life.cycles.device = "CPU"
    assert not samples_on_card(life)
    life.cycles.device = "GPU"  # but no card is chosen in the preferences
    assert not samples_on_card(life)


def test_a_shot_is_the_same_and_finished_while_the_next_is_sampled(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = render_request(scale=1, samples=2, temporal_radius=1, accumulate_on="cpu")
    expected = dict(shots.render_shot(life, job, FRAMES))
    threads: list[str] = []
    finish = FullSize.finish

    def noted(*args: Any, **choices: Any) -> Any:
        threads.append(threading.current_thread().name)
        return finish(*args, **choices)

    monkeypatch.setattr(FullSize, "finish", noted)
    monkeypatch.setattr(shots, "samples_on_card", lambda _: True)
    found = dict(shots.render_shot(life, job, FRAMES))
    assert list(found) == list(FRAMES)
    for number, picture in found.items():
        np.testing.assert_array_equal(picture.radiance, expected[number].radiance)
    assert len(threads) == len(FRAMES)
    assert all(name.startswith("finish") for name in threads)
