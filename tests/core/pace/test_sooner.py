"""Where fewer samples are no sooner, one line says so."""

from __future__ import annotations

import pytest

from xrds_core.pace.worth import Clock


def shot(taken: float) -> Clock:
    """Ten frames of half of the samples, for all of which Cycles would take 9 s."""
    clock = Clock(denoising=2.0)
    clock.leave_out(0.0)
    for number in range(1, 11):
        clock.add(taken * number, {"sync": 1.0, "beauty": 3.0}, 0.5)
    return clock


@pytest.mark.parametrize(("taken", "lines"), [(5.0, 0), (9.5, 0), (20.0, 1)])
def test_it_is_said_once_where_cycles_would_be_sooner(
    taken: float, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    shot(taken)
    said = capsys.readouterr().err
    assert said.count("\n") == lines
    if lines:
        assert "takes 20 s a frame here, Cycles with its denoiser about 9 s" in said


def test_frames_that_are_measured_in_do_not_count(
    capsys: pytest.CaptureFixture[str],
) -> None:
    clock = Clock(denoising=2.0)
    for number in range(10):
        now = 100.0 * number
        clock.leave_out(now)
        clock.add(now + 5.0, {"sync": 1.0, "beauty": 3.0}, 0.5)
    assert not capsys.readouterr().err


def test_the_first_frames_do_not_count_once_it_is_measured_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    clock, now = Clock(denoising=2.0), 0.0
    for taken in (None, *[20.0] * 4, None, *[5.0] * 6):
        if taken is None:
            now += 30.0
            clock.leave_out(now)
        else:
            now += taken
            clock.add(now, {"sync": 1.0, "beauty": 3.0}, 0.5)
    assert not capsys.readouterr().err
