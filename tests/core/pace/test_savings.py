"""Fewer samples are to save a tenth of Cycles' seconds."""

from __future__ import annotations

import pytest

from xrds_core.pace.savings import Savings

FRAME = {"sync": 1.0, "beauty": 3.0}


def shot(taken: float) -> Savings:
    """Ten frames of half of the samples, for all of which Cycles would take 9 s."""
    savings = Savings(16, denoising=2.0)
    savings.leave_out(0.0)
    for number in range(1, 11):
        savings.add(taken * number, FRAME, 0.5)
    return savings


@pytest.mark.parametrize(
    ("taken", "are_enough"), [(5.0, True), (8.0, True), (8.2, False), (20.0, False)]
)
def test_they_are_of_cycles_seconds(taken: float, are_enough: bool) -> None:
    savings = shot(taken)
    assert savings.are_known
    assert savings.seconds == pytest.approx((taken, 9.0))
    assert savings.are_enough == are_enough


def test_frames_that_are_measured_in_do_not_count() -> None:
    savings = Savings(16, denoising=2.0)
    for number in range(10):
        now = 100.0 * number
        savings.leave_out(now)
        savings.add(now + 5.0, FRAME, 0.5)
    assert not savings.are_known


def test_the_first_frames_do_not_count_once_it_is_measured_again() -> None:
    savings, now = Savings(16, denoising=2.0), 0.0
    for taken in (None, *[20.0] * 4, None, *[5.0] * 6):
        if taken is None:
            now += 30.0
            savings.leave_out(now)
        else:
            now += taken
            savings.add(now, FRAME, 0.5)
    assert savings.are_enough


def test_a_machine_that_stood_still_does_not_decide() -> None:
    savings, now = Savings(16, denoising=2.0), 0.0
    savings.leave_out(now)
    for pause in (0.0, 0.0, 600.0, 0.0, 0.0):
        now += 5.0 + pause
        savings.add(now, FRAME, 0.5)
    assert savings.are_known
    assert savings.are_enough


@pytest.mark.parametrize(
    ("start", "sample"), [(0.0, 0.5), (0.4, 0.01), (0.1, 0.1), (0.4, 0.0)]
)
def test_a_render_takes_more_than_its_samples(start: float, sample: float) -> None:
    """On a card most of a render of few samples is none of them."""
    savings = Savings(16, denoising=0.2, one=start + sample)
    for share in (0.25, 0.5, 0.75):
        beauty = 2 * start + 16 * share * sample
        savings.leave_out(0.0)
        savings.add(1.0, {"beauty": beauty}, share)
        _, theirs = savings.seconds
        assert theirs == pytest.approx(start + 16 * sample + 0.2)


def test_a_slow_moment_makes_all_samples_no_dearer_than_a_share_of_them() -> None:
    for one, least in ((5.0, 5.0), (0.0, 8.0)):
        savings = Savings(16, one=one)
        savings.leave_out(0.0)
        savings.add(1.0, {"beauty": 2.0}, 0.25)
        assert least <= savings.seconds[1] <= 8.0
    savings = Savings(16, one=1.0)
    savings.leave_out(0.0)
    savings.add(1.0, {"beauty": 2.0}, 0.125)  # each of two renders has one sample
    assert savings.seconds[1] == 16.0
