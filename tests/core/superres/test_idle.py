"""Where the network is left out, and that nothing is missed there."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from xrds_core.arrays import Array
from xrds_core.superres.front_end import demodulated_base
from xrds_core.superres.idle import write_base
from xrds_core.superres.inputs import check
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler

SIDE, SCALE = 320, 2
THING = slice(128, 160)  # low-resolution rows and columns that are not background


def make(preset: str = "fast") -> Upscaler:
    torch.manual_seed(3)
    network = XRDS(preset_config(preset, SCALE))
    torch.nn.init.normal_(network.tail.predict.weight, std=0.1)
    return Upscaler(preset, SCALE, device="cpu", weights=network)


@pytest.fixture(scope="module")
def fast() -> Upscaler:
    return make()


def enlarged(x: Array) -> Array:
    return x.repeat(SCALE, 0).repeat(SCALE, 1)


def shot(background: Array) -> tuple[Array, Array, Array]:
    """Radiance, albedo and normal of a textured thing before a background."""
    rng = np.random.default_rng(0)
    low = background.copy()
    low[THING, THING] = rng.random((32, 32, 3), np.float32)
    albedo = enlarged(background)
    normal = np.zeros_like(albedo)
    inside = slice(THING.start * SCALE, THING.stop * SCALE)
    albedo[inside, inside] = rng.random((64, 64, 3), np.float32)
    normal[inside, inside] = (0.0, 0.0, 1.0)
    return low, albedo, normal


def gradient() -> Array:
    rise = np.linspace(0.1, 0.9, SIDE, dtype=np.float32)
    return np.broadcast_to(rise[:, None, None], (SIDE, SIDE, 3)).copy()


@pytest.mark.parametrize("background", [np.zeros((SIDE, SIDE, 3), "f4"), gradient()])
def test_a_background_is_the_base_and_the_thing_is_as_before(
    fast: Upscaler, background: Array
) -> None:
    low, albedo, normal = shot(background)
    seen: list[float] = []
    short = fast(low, albedo, normal, progress=seen.append).radiance
    whole = fast(low, albedo, normal, skip_idle=False).radiance
    inside = slice(THING.start * SCALE, THING.stop * SCALE)
    difference = np.abs(short - whole)[inside, inside]
    assert difference.max() < 0.01 * whole.max()
    base = demodulated_base(low, albedo, SCALE)
    np.testing.assert_array_equal(short[:32], base[:32])  # rows that are idle
    assert seen[-1] == 1.0


def test_bands_of_the_base_meet() -> None:
    rng = np.random.default_rng(3)
    low = rng.random((150, 7, 3), np.float32)
    albedo, normal = rng.random((2, 299, 13, 3), np.float32)
    base = np.empty_like(albedo)
    write_base(base, check(SCALE, low, albedo, normal))
    padded = np.pad(albedo, ((0, 1), (0, 1), (0, 0)), "edge")
    expected = demodulated_base(low, padded, SCALE)[:299, :13]
    np.testing.assert_allclose(base, expected, rtol=1e-6)


def test_what_fills_the_picture_is_all_computed(fast: Upscaler) -> None:
    rng = np.random.default_rng(1)
    low = rng.random((64, 64, 3), np.float32)
    albedo, normal = rng.random((2, 128, 128, 3), np.float32)
    short = fast(low, albedo, normal).radiance
    np.testing.assert_array_equal(
        short, fast(low, albedo, normal, skip_idle=False).radiance
    )


def test_an_even_picture_needs_no_network(fast: Upscaler) -> None:
    low = np.full((64, 64, 3), 0.4, np.float32)
    albedo = np.full((128, 128, 3), 0.5, np.float32)
    result = fast(low, albedo, np.full_like(albedo, 0.6))
    assert result.tiles == 0
    np.testing.assert_allclose(result.radiance, 0.4, rtol=1e-5)


@pytest.mark.parametrize("value", [3e38, 3.4e38])
def test_the_brightest_even_picture_stays_finite(fast: Upscaler, value: float) -> None:
    low = np.full((16, 16, 3), value, np.float32)
    albedo = np.full((32, 32, 3), 0.5, np.float32)
    picture = fast(low, albedo, np.full_like(albedo, 0.6)).radiance
    np.testing.assert_allclose(picture, low[0, 0, 0], rtol=1e-5)


@pytest.mark.parametrize("wrong", ["no normals", "bright sky", "light on nothing"])
def test_doubts_are_computed(fast: Upscaler, wrong: str) -> None:
    """Guides without normals, a sky that albedo cannot hold, fog over black."""
    low, albedo, normal = shot(gradient())
    if wrong == "no normals":
        low *= np.random.default_rng(2).random((SIDE, SIDE, 1), np.float32)
        normal[:] = 0.0
    elif wrong == "bright sky":
        low, albedo = 5 * low, 5 * albedo
    else:
        albedo[:128] = 0.0
    short, whole = (
        fast(low, albedo, normal, skip_idle=skip).radiance for skip in (True, False)
    )
    np.testing.assert_array_equal(short[:64], whole[:64])


def test_odd_sizes_and_tiles(fast: Upscaler) -> None:
    low, albedo, normal = shot(np.zeros((SIDE, SIDE, 3), "f4"))
    low, albedo, normal = low[:181, :183], albedo[:361, :365], normal[:361, :365]
    whole = fast(low, albedo, normal, skip_idle=False).radiance
    tiled = fast(low, albedo, normal, tile=96)
    assert tiled.radiance.shape == whole.shape
    assert np.abs(tiled.radiance - whole).max() < 0.02 * whole.max()
