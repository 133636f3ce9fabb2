"""Which parts of a picture take more samples: sums, bounds, and what decides."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mitsuba_oidn")

from xrds_core import allocation
from xrds_core.allocation import Half, allot, split

HEIGHT, WIDTH = 270, 402  # no multiple of a tile


def halves(noise: np.ndarray | float, light: float = 0.5) -> list[Half]:
    """Two halves of a flat picture whose noise is as strong as the map says."""
    random = np.random.default_rng(5)
    flat = np.full((HEIGHT, WIDTH, 3), light, np.float32)
    guides = [np.full_like(flat, 0.5) for _ in range(4)]

    def radiance() -> np.ndarray:
        spread = random.standard_normal((HEIGHT, WIDTH, 1)).astype(np.float32)
        return np.maximum(flat + np.asarray(noise, np.float32) * spread, 0.0)

    return [Half(radiance(), guides.pop(), guides.pop()) for _ in range(2)]


def counts(parts: list, taken: int) -> np.ndarray:
    total = np.full((HEIGHT, WIDTH), taken)
    for place, more in parts:
        assert more > 0
        rows = slice(place.y, place.y + place.height)
        total[rows, place.x : place.x + place.width] += more
    return total


def test_noisy_parts_take_more_and_the_sum_is_as_asked() -> None:
    noise = np.zeros((HEIGHT, WIDTH, 1), np.float32)
    noise[40:140, 200:320] = 0.4
    total = counts(allot(halves(noise), 4, 8, 32, 0.0), 4)
    assert total.mean() == pytest.approx(8, rel=0.05)
    assert total[60:120, 220:300].mean() > 2 * total[180:].mean()
    assert total.min() >= 4
    assert total.max() <= 32


@pytest.mark.parametrize("light", [0.0, 1.0])
def test_without_any_noise_all_take_the_same(light: float) -> None:
    np.testing.assert_array_equal(
        counts(allot(halves(0.0, light), 4, 8, 32, 0.0), 4), 8
    )


def test_what_meets_nothing_is_cheap_and_takes_more_for_the_same_cost() -> None:
    pictures = halves(0.3)
    for half in pictures:
        half.normal[:, : WIDTH // 2] = 0.0
    total = counts(allot(pictures, 4, 16, 64, 0.0), 4)
    sky, ground = total[:, : WIDTH // 2].mean(), total[:, WIDTH // 2 :].mean()
    assert sky > 1.3 * ground
    cost = allocation.MISS_COST
    assert (cost * sky + ground) / (1 + cost) == pytest.approx(16, rel=0.05)


def test_exposure_decides_what_is_seen() -> None:
    noise = np.zeros((HEIGHT, WIDTH, 1), np.float32)
    noise[:, :200], noise[:, 200:] = 0.2, 0.002
    light = np.where(noise > 0.1, 40.0, 0.02)
    pictures = [
        Half((each.radiance - 0.5) + light, each.albedo, each.normal)
        for each in halves(noise)
    ]
    dark = counts(allot(pictures, 4, 8, 32, -8.0), 4)
    bright = counts(allot(pictures, 4, 8, 32, 6.0), 4)
    assert bright[:, :150].mean() < dark[:, :150].mean()


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (33, 500)])
def test_any_size(size: tuple[int, int]) -> None:
    random = np.random.default_rng(1)
    pictures = [Half(*random.random((3, *size, 3), np.float32)) for _ in range(2)]
    total = np.full(size, 2)
    for place, more in allot(pictures, 2, 4, 16, 0.0):
        total[place.y :, place.x :][: place.height, : place.width] += more
    assert total.mean() == pytest.approx(4, rel=0.15)


def test_parts_cover_everything_once() -> None:
    error = np.random.default_rng(2).random((17, 26)) ** 4
    covered = np.zeros_like(error)
    parts = split(error, np.ones_like(error), 32)
    for part in parts:
        inside = slice(part.top, part.bottom), slice(part.left, part.right)
        covered[inside] += 1
        assert part.error == pytest.approx(error[inside].mean())
    np.testing.assert_array_equal(covered, 1)
    assert 10 < len(parts) <= 32


def test_splits_follow_the_edges() -> None:
    error = np.full((20, 20), 0.01)
    error[4:12, 6:16] = 1.0
    parts = split(error, np.ones_like(error), 8)
    assert any(part[:4] == (4, 12, 6, 16) for part in parts)
