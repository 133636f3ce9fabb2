"""Flicker: how errors change along with what moves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import HEIGHT, PIXEL, WIDTH, World, camera, view

from xrds_lab.shots.flicker import flicker

Array = NDArray[np.float64]
SHIFT = 3  # pixels by which the wall moves to the left
EYES = camera(0.0), camera(SHIFT * PIXEL * 10.0)  # the wall is 10 away
FRAMES = tuple(view(n, eye, World(wall_half=1e4)).frame for n, eye in enumerate(EYES))
SHAPE = (HEIGHT, WIDTH, 3)


def noise(seed: int, deviation: float) -> Array:
    return np.random.default_rng(seed).normal(0.0, deviation, SHAPE)


def of_errors(before: Array, after: Array, reference_noise: float = 0.0) -> float:
    truth = noise(9, 0.2), noise(10, 0.2)
    shown = truth[0] + before, truth[1] + after
    first, second = (
        (truth[0] + noise(s, reference_noise), truth[1] + noise(s + 1, reference_noise))
        for s in (20, 22)
    )
    return flicker(shown, (first, second), FRAMES)


def test_errors_that_move_along_are_none() -> None:
    error = noise(1, 0.1)
    assert of_errors(error, np.roll(error, -SHIFT, axis=1)) < 1e-3
    assert of_errors(error, error) > 0.1  # the same at every pixel, as on a dirty pane


def test_errors_of_their_own_add_up() -> None:
    assert of_errors(noise(1, 0.1), noise(2, 0.1)) == pytest.approx(
        0.1 * 2**0.5, rel=0.05
    )


def test_noise_of_the_references_is_not_counted() -> None:
    before, after = noise(1, 0.1), noise(2, 0.1)
    clean, noisy = (of_errors(before, after, x) for x in (0.0, 0.1))
    assert noisy == pytest.approx(clean, rel=0.1)
