"""What neighbours' samples are worth, from what is measured in a shot."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_core.pace.worth import FALL, Errors, Worth, measurements

SHARE, GAIN, NEIGHBOURS = 0.25, 9.0, 8


def errors(
    worth: float, spread: float = 0.0, seed: int = 0, fall: float = FALL
) -> Errors:
    """What is measured if neighbours are worth so much, and noise hides it so much."""
    equal = SHARE * (1.0 + (GAIN - 1.0) * worth)
    chance = np.random.default_rng(seed).normal(0.0, spread, (3, 64))
    return Errors(equal**-fall + chance[0], 1.0 + chance[1], SHARE**-fall + chance[2])


@pytest.mark.parametrize("worth", [0.0, 0.3, 1.0])
def test_it_is_found_from_errors(worth: float) -> None:
    found = Worth()
    found.add(errors(worth), SHARE, GAIN, NEIGHBOURS)
    assert worth - 0.2 < found.value < worth + 0.05  # the usual one counts as well


@pytest.mark.parametrize("fall", [0.5, 1.0])
def test_it_is_found_however_errors_fall_with_samples(fall: float) -> None:
    found = Worth()
    found.add(errors(0.5, fall=fall), SHARE, GAIN, NEIGHBOURS)
    assert found.fall == pytest.approx(fall, abs=0.03)
    assert 0.4 < found.value < 0.5


def test_errors_fall_as_usual_where_nothing_shows_how() -> None:
    found = Worth()
    assert found.fall == pytest.approx(FALL, abs=0.01)
    found.add(errors(0.5, spread=500.0, fall=1.0), SHARE, GAIN, NEIGHBOURS)
    assert found.fall == pytest.approx(FALL, abs=0.1)
    found.add(errors(0.5, fall=1.0), 1.0, 1.0, NEIGHBOURS)  # that frame had all samples
    assert found.fall == pytest.approx(FALL, abs=0.1)


def test_it_is_the_usual_one_where_chance_hides_it() -> None:
    values = []
    for worth in (0.1, 0.9):
        found = Worth()
        found.add(errors(worth, spread=500.0), SHARE, GAIN, NEIGHBOURS)
        values.append(found.value)
    assert values[0] == pytest.approx(values[1], abs=0.1)
    assert 0.1 < values[0] < 0.45


def test_neighbours_that_show_something_else_are_worth_nothing() -> None:
    found = Worth()
    alone = np.full(64, SHARE**-FALL)
    bad = Errors(np.full(64, 50.0), np.ones(64), alone)
    found.add(bad, SHARE, GAIN, NEIGHBOURS)
    assert found.value < 0.01


def test_chance_counts_less_the_more_is_measured() -> None:
    found, values = Worth(), []
    for seed in range(4):
        found.add(errors(0.7, 1.5, seed), SHARE, GAIN, NEIGHBOURS)
        values.append(found.value)
    assert values[0] < 0.55
    assert values[0] + 0.03 < values[-1] < 0.8


def test_what_a_shot_showed_long_ago_is_forgotten() -> None:
    found = Worth()
    for worth in (0.1, 0.1, 0.1, 0.6, 0.6, 0.6, 0.6):
        found.add(errors(worth), SHARE, GAIN, NEIGHBOURS)
    assert 0.5 < found.value < 0.6


def test_neighbours_on_one_side_count_until_there_are_two() -> None:
    found = Worth()
    assert found.is_due(4)
    found.add(errors(0.1), SHARE, GAIN, 4)
    found.add(errors(0.6), SHARE, GAIN, NEIGHBOURS)
    assert 0.5 < found.value < 0.6


@pytest.mark.parametrize("price", [0.1, 1.0])
@pytest.mark.parametrize("frames", [5, 6, 17, 18, 19, 48, 200])
def test_how_often_it_is_measured_is_known_before(frames: int, price: float) -> None:
    found, due = Worth(), []
    for frame in range(1, frames + 1):
        neighbours = NEIGHBOURS if frame > 5 else 4
        if found.is_due(neighbours):
            found.add(errors(0.5), SHARE, GAIN, neighbours, price)
            due.append(frame)
    assert len(due) == measurements(frames, NEIGHBOURS, price), due
    later = np.diff(due[1:])
    assert (later >= 12).all()
    assert (price / later <= 0.03).all()  # of the samples of these frames
