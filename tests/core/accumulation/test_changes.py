"""Light that changes, found by neighbours that do not agree with each other."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from specification.similarity import changes

Array = NDArray[np.float32]
SHAPE = (45, 62)
NEIGHBOURS = 8
SIZES = 4  # of areas, whose errors add up


def error(lights: list[Array], noise: float, weight: float = 4.0) -> Array:
    rng = np.random.default_rng(1)
    neighbours = []
    for light in lights:
        grain, other = noise * rng.standard_normal((2, *SHAPE))
        weights = np.full(SHAPE, weight, np.float32)
        # what the halves of a frame tell of its noise is as noisy as it is
        neighbours.append((np.float32(light + grain), np.float32(other), weights))
    return changes(neighbours, SHAPE)


def test_noise_alone_is_no_change() -> None:
    still = error([np.zeros(SHAPE, np.float32)] * NEIGHBOURS, 0.2)
    assert still.shape == SHAPE
    assert still.mean() < 0.005 * 0.2**2


def test_neighbours_without_noise_show_how_much_light_varies() -> None:
    lights = [np.full(SHAPE, n, np.float32) for n in range(NEIGHBOURS)]
    found = error(lights, 0.0) / SIZES
    assert found == pytest.approx(np.var(range(NEIGHBOURS), ddof=1), rel=1e-3)


@pytest.mark.parametrize(("noise", "least"), [(0.02, 0.2), (0.2, 0.05)])
def test_a_shadow_that_moves_is_found_where_it_passes(
    noise: float, least: float
) -> None:
    lights = [np.full(SHAPE, 0.7, np.float32) for _ in range(NEIGHBOURS)]
    for n, light in enumerate(lights):
        light[:, 20 + 3 * n : 23 + 3 * n] -= 0.3
    found = error(lights, noise)
    passed, spared = found[:, 22:42].mean(), found[:, :8].mean()
    assert passed > 20 * spared
    assert passed > least * SIZES * np.var([-0.3] + [0.0] * (NEIGHBOURS - 1), ddof=1)


def test_what_no_neighbour_shows_is_no_change() -> None:
    lights = [np.full(SHAPE, n, np.float32) for n in range(NEIGHBOURS)]
    assert not error(lights, 0.1, weight=0.0).any()
    assert not error(lights[:1], 0.0).any()
    assert not error([], 0.0).any()
