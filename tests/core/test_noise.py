"""The noise of guides, told from their texture by the guides alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from xrds_core.temporal.halves import Halves
from xrds_core.temporal.noise import noise_of

SHAPE = 64, 96
RNG = np.random.default_rng(5)
DARK = np.full((2, *SHAPE, 3), 0.25, np.float32)


def noise_of_guides(albedo: NDArray[np.float32], samples: float) -> float:
    """The root of the mean variance found of an albedo (H, W), away from its rim."""
    guides = np.zeros((*SHAPE, 6), np.float32)
    guides[..., :3] = albedo[..., None]
    found = noise_of(Halves(DARK, DARK, DARK), guides, samples, np.float32).guides
    inner = found.reshape(SHAPE)[1:-1, 1:-1]
    return float(np.sqrt(np.square(inner).mean()))


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_noise_is_found(noise: float) -> None:
    albedo = (0.5 + noise * RNG.standard_normal(SHAPE)).astype(np.float32)
    found = noise_of_guides(albedo, samples=1) / (noise * 3**0.5)
    assert found == pytest.approx(1.08, rel=0.1)


def test_the_more_samples_the_less_of_it_is_believed() -> None:
    albedo = RNG.random(SHAPE).astype(np.float32)
    found = [noise_of_guides(albedo, n) for n in (1, 2, 4, 16, 4096)]
    assert found == sorted(found, reverse=True)
    assert found[-1] > 0.5 * found[0]


@pytest.mark.parametrize("slope", [(1, 0), (0, 1), (1, 1), (1, -1)])
def test_edges_and_lines_are_no_noise(slope: tuple[int, int]) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    across = slope[0] * y + slope[1] * x
    for texture in (across > 40, across % 7 == 0, across / 100):
        assert noise_of_guides(texture.astype(np.float32), samples=2) < 0.02
