"""Denoised parts add up to the denoised picture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from xrds_core.denoising.light_sums import add_up, completed

Array = NDArray[np.float32]
SHAPE = (140, 5, 3)
LIGHT = st.floats(0.0, 1000.0, width=32)


def light(seed: int, mean: float = 1.0) -> Array:
    random = np.random.default_rng(seed)
    return random.exponential(mean, SHAPE).astype(np.float32)


def test_parts_that_add_up_stay_as_they_are() -> None:
    parts = {"key": light(1), "fill": light(2)}
    found = add_up(parts["key"] + parts["fill"], parts)
    for name, part in parts.items():
        assert found[name] == pytest.approx(part, rel=1e-5)


def test_the_rest_goes_where_the_light_is() -> None:
    parts = {"key": np.full(SHAPE, 3.0, np.float32), "fill": np.ones(SHAPE, np.float32)}
    found = add_up(np.full(SHAPE, 5.0, np.float32), parts)
    assert found["key"] == pytest.approx(3.9, rel=1e-5)
    assert found["fill"] == pytest.approx(1.1, rel=1e-5)


@given(st.lists(arrays(np.float32, (2, 2, 3), elements=LIGHT), min_size=2, max_size=5))
def test_they_always_add_up_and_are_never_negative(given_: list[Array]) -> None:
    picture, *rest = given_
    parts = {str(n): part for n, part in enumerate(rest)}
    found = add_up(picture, parts)
    assert all((part >= 0.0).all() for part in found.values())
    assert sum(found.values()) == pytest.approx(picture, rel=1e-4, abs=1e-6)


def test_a_part_has_no_light_where_its_colour_is_black() -> None:
    parts = {"diffuse": light(1), "emission": light(2)}
    colour = np.ones(SHAPE, np.float32)
    colour[:70] = 0.0
    picture = light(3)
    found = add_up(picture, parts, {"diffuse": colour})
    assert not found["diffuse"][:70].any()
    assert found["emission"][:70] == pytest.approx(picture[:70], rel=1e-5)
    assert sum(found.values()) == pytest.approx(picture, rel=1e-5)


def test_what_is_not_finite_is_survived() -> None:
    parts = {"key": light(1), "fill": light(2)}
    parts["key"][0, 0] = np.nan
    parts["fill"][1, 1] = np.inf
    found = add_up(light(3), parts)
    assert all(np.isfinite(part).all() for part in found.values())


def test_a_part_that_is_dark_everywhere_stays_so() -> None:
    parts = {"key": light(1), "off": np.zeros(SHAPE, np.float32)}
    picture = light(2)
    found = add_up(picture, parts)
    assert not found["off"].any()
    assert found["key"] == pytest.approx(picture, rel=1e-5)


def test_a_colour_that_few_samples_missed_is_that_around() -> None:
    colour = np.full((6, 8, 3), 0.5, np.float32)
    colour[2, 3] = 0.0
    colour[2, 3, 1] = 0.2
    colour[:, 5:] = 0.0  # nothing of the lobe at all
    colour[0, 0] = np.nan
    found = completed(colour)
    assert found[2, 3] == pytest.approx([0.5 * 8 / 9, 0.2, 0.5 * 8 / 9])
    assert not found[:, 6:].any()
    assert (found[:, 5] > 0.0).all()
    assert (found[0, 0] > 0.0).all()
    known = (colour > 0.0) & np.isfinite(colour)
    assert np.array_equal(found[known], colour[known])
