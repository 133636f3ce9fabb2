"""The noise of light and of guides, told from texture by the pixels around."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import camera

from xrds_core.accumulation.frame import Frame, pack_frame
from xrds_core.accumulation.noise import Noise

SHAPE = 64, 96
RNG = np.random.default_rng(5)


def noise_of(
    radiance: NDArray[np.float32], albedo: NDArray[np.float32], samples: float
) -> Noise:
    """The noise told of a frame without halves, whose passes are grey (H, W)."""
    light, guide = (np.repeat(x[..., None], 3, axis=-1) for x in (radiance, albedo))
    flat, depth = np.zeros((*SHAPE, 3), np.float32), np.ones(SHAPE, np.float32)
    frame = Frame(
        number=1,
        camera=camera(),
        radiance=light,
        albedo=guide,
        normal=flat,
        depth=depth,
        samples=samples,
    )
    noise = pack_frame(frame)[2]
    assert noise is not None
    return noise


def found_in(albedo: NDArray[np.float32], samples: float) -> float:
    """The root of the mean variance found of an albedo (H, W), away from its rim."""
    found = noise_of(np.ones(SHAPE, np.float32), albedo, samples).guides
    inner = found.astype(np.float32).reshape(SHAPE)[1:-1, 1:-1]
    return float(np.sqrt(np.square(inner).mean()))


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_noise_is_found(noise: float) -> None:
    albedo = (0.5 + noise * RNG.standard_normal(SHAPE)).astype(np.float32)
    found = found_in(albedo, samples=1) / (noise * 3**0.5)
    assert found == pytest.approx(1.08, rel=0.1)


def test_the_more_samples_the_less_of_it_is_believed() -> None:
    albedo = RNG.random(SHAPE).astype(np.float32)
    found = [found_in(albedo, n) for n in (1, 2, 4, 16, 4096)]
    assert found == sorted(found, reverse=True)
    assert found[-1] > 0.5 * found[0]


@pytest.mark.parametrize("slope", [(1, 0), (0, 1), (1, 1), (1, -1)])
def test_edges_and_lines_are_no_noise(slope: tuple[int, int]) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    across = slope[0] * y + slope[1] * x
    for texture in (across > 40, across % 7 == 0, across / 100):
        assert found_in(texture.astype(np.float32), samples=2) < 0.02


def noise_of_light(radiance: NDArray[np.float32], albedo: NDArray[np.float32]) -> float:
    """The same of the light of a frame of 16 samples without halves."""
    found = noise_of(radiance, albedo, 16.0).difference.astype(np.float32)
    inner = found.reshape(SHAPE)[4:-4, 4:-4]
    return float(np.sqrt(np.square(inner).mean()))


TEXTURE = RNG.choice(np.float32([0.2, 0.8]), SHAPE)


def test_without_halves_the_noise_of_light_is_found_around() -> None:
    root = 1.0 + 0.05 * RNG.standard_normal(SHAPE).astype(np.float32)
    assert noise_of_light(root**2, np.ones(SHAPE, np.float32)) == pytest.approx(
        0.05, rel=0.1
    )


def test_the_texture_of_albedo_is_no_noise_of_light() -> None:
    textured = noise_of_light(TEXTURE, TEXTURE)
    assert textured < 0.3 * noise_of_light(TEXTURE, np.full(SHAPE, 0.5, np.float32))


def test_nor_is_that_of_an_albedo_that_light_does_not_follow() -> None:
    even = np.ones(SHAPE, np.float32)
    assert noise_of_light(even, TEXTURE) < 0.01
