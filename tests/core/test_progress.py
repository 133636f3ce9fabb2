"""Time left, on a clock that the test drives."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from xrds_core.progress import ShotClock, duration

SAMPLING, FINISHING, RADIUS, FRAMES = 10.0, 4.0, 4, 24


class Time:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def shot(time: Time, clock: ShotClock, dear: int = 0) -> Iterator[tuple[int, float]]:
    """Drive a shot as Blender renders it; yields the seconds that are truly left."""
    sampling = [SAMPLING * (100.0 if n == dear else 1.0) for n in range(1, FRAMES + 1)]
    whole, sampled = sum(sampling) + FRAMES * FINISHING, 0
    for number in range(1, FRAMES + 1):
        while sampled < min(number + RADIUS, FRAMES):
            time.now += sampling[sampled]
            sampled += 1
            clock.sampled()
        time.now += FINISHING
        clock.finished()
        yield number, whole - time.now


def test_what_is_sampled_and_what_is_finished_both_count() -> None:
    time = Time()
    clock = ShotClock(FRAMES, FRAMES, now=time)
    assert clock.left() is None
    fractions = []
    for _, left in shot(time, clock):
        assert clock.left() == pytest.approx(left)
        fractions.append(clock.fraction())
    assert fractions == sorted(fractions)
    assert fractions[0] == pytest.approx(54.0 / (FRAMES * 14.0))
    assert clock.left() == 0.0
    assert fractions[-1] < 1.0


def test_a_dear_first_frame_is_soon_forgotten() -> None:
    time = Time()
    clock = ShotClock(FRAMES, FRAMES, now=time)
    for number, left in shot(time, clock, dear=1):
        if number > 1:
            assert clock.left() == pytest.approx(left)


def test_before_the_first_frame_is_finished() -> None:
    time = Time()
    clock = ShotClock(2, 2, finishing=5.0, now=time)
    time.now += 3.0
    clock.sampled()
    assert clock.left() == pytest.approx(3.0 + 2 * 5.0)
    time.now += 1.0
    assert clock.left() == pytest.approx(12.0)
    clock.add(1, 1)  # another layer's frame
    assert clock.left() == pytest.approx(12.0 + 3.0 + 5.0)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (4.24, "4.2 s"),
        (45.2, "45 s"),
        (720, "12 min"),
        (12_240, "3 h 24 min"),
        (360_000 * 2, "200 h"),
    ],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text
