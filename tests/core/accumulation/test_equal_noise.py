"""Frames of one seed are found, at any speed; honest ones never."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sequences
import shots

from xrds_core.accumulation.equal_noise import IndependentFrames, have_equal_noise
from xrds_core.accumulation.frame import Stored, store

SPEEDS = (0.0, 0.01, 0.06, 0.156, 0.5)  # a pixel of the wall is 0.156 wide
Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


def frame(number: int, speed: float, seed: int, change: Change) -> Stored:
    """A frame of even albedo, but for what `change` makes of light and of noise."""
    view = shots.view(number, sequences.single(shots.camera(x=speed * number)))
    noise = np.random.default_rng(seed).gamma(4, 1 / 4, (*view.frame.shape, 1))
    light = change(view.colour, noise).astype(np.float32)
    albedo = np.full_like(light, 0.5)
    return store(replace(view.frame, radiance=light, albedo=albedo, samples=4.0))


def noisy(colour: Any, noise: Any) -> Any:
    return colour * noise


def textured(colour: Any, noise: Any) -> Any:
    """Checks that no guide shows, of far more contrast than noise."""
    checks = np.floor(colour * 7) % 2
    return (0.2 + checks) * (0.95 + 0.05 * noise)


HONEST = {
    "noise of its own": noisy,
    "a texture": textured,
    "no noise": lambda colour, noise: colour,
    "a flat picture": lambda colour, noise: np.full_like(colour, 0.3),
    "noise of few pixels": lambda colour, noise: np.where(
        np.arange(colour.shape[1])[:, None] < 4, colour * noise, colour
    ),
}


@pytest.mark.parametrize("speed", SPEEDS)
def test_one_seed_is_found_at_any_speed(speed: float) -> None:
    assert have_equal_noise(*(frame(n, speed, 7, noisy) for n in (1, 2)))


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("kind", HONEST)
def test_honest_frames_are_none_of_one_seed(kind: str, speed: float) -> None:
    assert not have_equal_noise(*(frame(n, speed, n, HONEST[kind]) for n in (1, 2)))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 2), (3, 3), (8, 8)])
def test_few_pixels_say_nothing(shape: tuple[int, int]) -> None:
    one = sequences.frame(1, shape=shape)
    assert not have_equal_noise(store(one), store(replace(one, number=2)))


def test_a_neighbour_counts_once() -> None:
    """Of seeds that come again, the nearest frame of each; one line says so."""
    seeds = {1: 5, 2: 6, 3: 7, 4: 6, 5: 7}
    frames = {n: frame(n, 0.2, seed, noisy) for n, seed in seeds.items()}
    said: list[str] = []
    independent = IndependentFrames(said.append)
    others = [frames[n] for n in (2, 4, 1, 5)]
    assert [x.number for x in independent.of(frames[3], others)] == [2, 1]
    assert [x.number for x in independent.of(frames[2], [frames[4]])] == []
    assert len(said) == 1
    assert "frames 2 and 4 hold the same noise" in said[0]
    assert "seed" in said[0]
