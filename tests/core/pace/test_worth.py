"""What neighbours' samples are worth, from what is measured in a shot."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_core.pace.worth import FALL, Ratio, Worth

SHARE, GAIN, NEIGHBOURS = 0.25, 9.0, 8


def ratio(worth: float, spread: float = 0.0, chance: float = 0.0) -> Ratio:
    """What is measured if neighbours are worth so much."""
    equal = SHARE * (1.0 + (GAIN - 1.0) * worth)
    return Ratio(equal**-FALL * (1.0 + chance), spread)


@pytest.mark.parametrize("worth", [0.0, 0.3, 1.0])
def test_it_is_found_from_errors(worth: float) -> None:
    found = Worth()
    found.add(ratio(worth), SHARE, GAIN, NEIGHBOURS)
    assert worth - 0.2 < found.value < worth + 0.05  # the usual one counts as well


def test_it_is_the_usual_one_where_chance_hides_it() -> None:
    values = []
    for worth in (0.1, 0.9):
        found = Worth()
        found.add(ratio(worth, spread=5.0), SHARE, GAIN, NEIGHBOURS)
        values.append(found.value)
    assert values[0] == pytest.approx(values[1], abs=0.1)
    assert 0.1 < values[0] < 0.45


def test_what_noise_hides_is_worth_nothing() -> None:
    found = Worth()
    found.add(Ratio(float("inf"), 0.0), SHARE, GAIN, NEIGHBOURS)
    assert found.value == 0.0


def test_chance_counts_less_the_more_is_measured() -> None:
    rng, found, values = np.random.default_rng(1), Worth(), []
    for _ in range(40):
        chance = rng.normal(0.0, 0.3)
        found.add(ratio(0.7, 0.3, chance), SHARE, GAIN, NEIGHBOURS)
        values.append(found.value)
    assert values[0] < 0.6
    assert 0.6 < values[-1] < 0.8


def test_neighbours_on_one_side_count_until_there_are_two() -> None:
    found = Worth()
    assert found.is_due(4)
    found.add(ratio(0.1), SHARE, GAIN, 4)
    found.add(ratio(0.6), SHARE, GAIN, NEIGHBOURS)
    assert 0.5 < found.value < 0.6


def test_it_is_measured_ever_more_seldom() -> None:
    found, due = Worth(), []
    for frame in range(1, 101):
        neighbours = min(3 + frame, NEIGHBOURS)
        if found.is_due(neighbours):
            found.add(ratio(0.5), SHARE, GAIN, neighbours)
            due.append(frame)
    assert due[0] == 1
    assert due[-1] > 40
    assert len(due) <= 8
