from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
import torch
from torch.nn import functional

from xrds_core.arrays import Array
from xrds_core.errors import Cancelled, PictureError, UsageError, WeightsError
from xrds_core.superres import upscaler, weights
from xrds_core.superres.front_end import transfer
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler, upscale
from xrds_lab.weights import save_network


def network(scale: int = 2, preset: str = "fast") -> XRDS:
    """A network that does something with all it sees, though it was never trained."""
    torch.manual_seed(3)
    net = XRDS(preset_config(preset, scale))
    if preset != "paper":
        torch.nn.init.normal_(net.tail.predict.weight, std=0.1)
    return net


def make(scale: int = 2, preset: str = "fast") -> Upscaler:
    return Upscaler(preset, scale, device="cpu", weights=network(scale, preset))


@pytest.fixture(scope="module")
def fast() -> Upscaler:
    return make()


def textured(height: int, width: int, channels: int, seed: int) -> Array:
    """Random blocks of several sizes, in [0, 1]."""
    torch.manual_seed(seed)
    layers = [
        functional.interpolate(
            torch.rand(1, channels, -(-height // k), -(-width // k)),
            scale_factor=float(k),
        )[..., :height, :width]
        for k in (1, 5, 16)
    ]
    return (sum(layers) / 3)[0].permute(1, 2, 0).numpy()


def picture(height: int, width: int, scale: int = 2) -> tuple[Array, Array, Array]:
    """Radiance and guides of one size; the light spans two decades."""
    radiance = 10.0 * textured(height, width, 3, seed=0) ** 4
    albedo = textured(scale * height, scale * width, 3, seed=1)
    normal = 2.0 * textured(scale * height, scale * width, 3, seed=2) - 1.0
    return radiance, albedo, normal


def range_error(result: Array, expected: Array, exposure: float) -> float:
    """Largest difference in the transfer domain, of the range of `expected`."""
    t, reference = transfer(result, exposure), transfer(expected, exposure)
    return float(np.abs(t - reference).max() / np.ptp(reference))


# --- sizes ----------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [2, 4, 8])
@pytest.mark.parametrize("size", [(1, 1), (1, 2), (7, 5), (65, 33)])
def test_every_size_is_enlarged(scale: int, size: tuple[int, int]) -> None:
    result = make(scale)(*picture(*size, scale)).radiance
    assert result.shape == (scale * size[0], scale * size[1], 3)
    assert result.dtype == np.float32
    assert np.isfinite(result).all()
    assert result.min() >= 0.0


def test_guides_may_end_before_the_low_resolution_picture(fast: Upscaler) -> None:
    radiance, albedo, normal = picture(9, 6)
    result = fast(radiance, albedo[:17, :11], normal[:17, :11]).radiance
    assert result.shape == (17, 11, 3)
    edge = ((0, 1), (0, 1), (0, 0))
    padded = (np.pad(x[:17, :11], edge, "edge") for x in (albedo, normal))
    np.testing.assert_allclose(result, fast(radiance, *padded).radiance[:17, :11])


@pytest.mark.parametrize("preset", ["balanced", "paper"])
def test_every_preset_runs(preset: str) -> None:
    result = make(4, preset=preset)(*picture(7, 5, 4)).radiance
    assert result.shape == (28, 20, 3)
    assert np.isfinite(result).all()


def test_radiance_before_denoising_is_seen(fast: Upscaler) -> None:
    low, *guides = picture(12, 12)
    grain = 2.0 * textured(12, 12, 3, seed=6)
    plain = fast(low, *guides).radiance
    np.testing.assert_array_equal(fast(low, *guides, noisy=low).radiance, plain)
    rough = fast(low, *guides, noisy=low * grain).radiance
    assert not np.allclose(rough, plain, rtol=0.01)
    grain[5, 5] = np.nan
    spoilt = fast(low, *guides, noisy=low * grain)
    assert spoilt.bad_pixels == 1
    assert np.isfinite(spoilt.radiance).all()
    with pytest.raises(PictureError, match="noisy is 11x12 pixels, but radiance is 12"):
        fast(low, *guides, noisy=low[:, :11])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pixel_without_alpha_keeps_its_colour(fast: Upscaler, bad: float) -> None:
    low, *guides = picture(12, 12)
    whole = np.dstack((low, np.ones((12, 12), np.float32)))
    spoilt = whole.copy()
    spoilt[5, 7, 3] = bad
    result = fast(spoilt, *guides)
    assert result.bad_pixels == 1
    np.testing.assert_array_equal(result.radiance, fast(whole, *guides).radiance)


@pytest.mark.parametrize("size", [1e20, 1e30, np.inf])
def test_weights_that_give_no_picture_are_told(size: float) -> None:
    """Finite ones, too: their file is read without complaint."""
    broken = make(preset="paper")
    with torch.no_grad():
        for weight in broken.network.tail.parameters():
            weight.fill_(size)
    with pytest.raises(WeightsError, match="its weights are damaged"):
        broken(*picture(8, 8))


def test_flipped_views_and_other_floats_are_taken(fast: Upscaler) -> None:
    inputs = picture(8, 8)
    expected = fast(*inputs).radiance
    views = (np.ascontiguousarray(x[::-1])[::-1] for x in inputs)
    np.testing.assert_array_equal(fast(*views).radiance, expected)
    doubles = (x.astype(np.float64) for x in inputs)
    np.testing.assert_array_equal(fast(*doubles).radiance, expected)


# --- what cannot be used --------------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((40, 60), r"60x40 .* 15x10 at scale 2 needs guides of 30x20.* use scale 4"),
        ((18, 30), r"30x18 .* 30x20, or fewer than 2 pixels less"),
        ((21, 30), r"30x21 .* 30x20"),
    ],
)
def test_guides_of_a_wrong_size(
    fast: Upscaler, size: tuple[int, int], message: str
) -> None:
    guide = np.zeros((*size, 3), np.float32)
    with pytest.raises(PictureError, match=message):
        fast(np.ones((10, 15, 3), np.float32), guide, guide)


def test_guides_of_two_sizes(fast: Upscaler) -> None:
    radiance, albedo, normal = picture(4, 4)
    with pytest.raises(PictureError, match="normal is 8x7 pixels, but albedo is 8x8"):
        fast(radiance, albedo, normal[:7])


@pytest.mark.parametrize(
    ("radiance", "message"),
    [
        (np.zeros((4, 4), np.float32), r"radiance has the shape \(4, 4\)"),
        (np.zeros((4, 4, 2), np.float32), r"height, width, 3 or 4"),
        (np.zeros((0, 4, 3), np.float32), r"\(0, 4, 3\)"),
        (np.zeros((4, 4, 3), np.uint8), "uint8.*floats"),
        (None, r"shape \(\)"),
    ],
)
def test_arrays_that_are_no_picture(
    fast: Upscaler, radiance: Array, message: str
) -> None:
    _, albedo, normal = picture(4, 4)
    with pytest.raises(PictureError, match=message):
        fast(radiance, albedo, normal)


@pytest.mark.parametrize("exposure", [0.0, -1.0, math.nan, math.inf])
def test_exposures_that_are_none(fast: Upscaler, exposure: float) -> None:
    with pytest.raises(UsageError, match="exposure"):
        fast(*picture(4, 4), exposure=exposure)


def test_devices_precisions_and_weights_that_are_not_there() -> None:
    with pytest.raises(UsageError, match="device 'abacus'"):
        Upscaler(device="abacus", weights=network())
    if not torch.backends.mps.is_available():
        with pytest.raises(UsageError, match="device 'metal'"):
            Upscaler(device="metal", weights=network())
    if not torch.cuda.is_available():
        with pytest.raises(UsageError, match="device 'cuda'"):
            Upscaler(device="cuda", weights=network())
    with pytest.raises(UsageError, match="precision 'fp8'"):
        Upscaler(precision="fp8", weights=network())
    with pytest.raises(WeightsError, match="scale 2"):
        Upscaler(scale=4, weights=network(2))


# --- bad pixels -----------------------------------------------------------------------

POISON = [np.nan, np.inf, -np.inf, -100.0, 65505.0, 3.4e38, 1e-40]


@pytest.mark.parametrize("value", POISON)
def test_poison_in_everything_gives_finite_light(fast: Upscaler, value: float) -> None:
    inputs = picture(16, 16)
    for x in inputs:
        x[3:5, 2] = value
    for exposure in (None, 1.0):
        result = fast(*inputs, exposure=exposure)
        assert np.isfinite(result.radiance).all()
        assert result.radiance.min() >= 0.0
    bad = not np.isfinite(value)
    assert result.bad_pixels == (6 if bad else 2 if value < 0.0 else 0)


@pytest.mark.parametrize("value", [np.nan, -100.0, 3.4e38])
def test_poison_reaches_no_farther_than_the_network_sees(
    fast: Upscaler, value: float
) -> None:
    clean, spoilt = picture(8, 180), picture(8, 180)
    for x in spoilt:
        x[2:4, 2] = value
    first, second = (fast(*x, exposure=0.1).radiance for x in (clean, spoilt))
    assert not np.array_equal(first[:, :8], second[:, :8])
    np.testing.assert_array_equal(first[:, 320:], second[:, 320:])


@pytest.mark.parametrize("value", POISON)
def test_constant_poison_gives_finite_light(fast: Upscaler, value: float) -> None:
    sizes = ((6, 5), (12, 10), (12, 10))
    result = fast(*(np.full((*size, 3), value, np.float32) for size in sizes))
    assert np.isfinite(result.radiance).all()
    assert result.radiance.min() >= 0.0


def test_an_emitter_and_no_normals(fast: Upscaler) -> None:
    radiance, albedo, normal = picture(8, 8)
    radiance[4, 4] = 1e6
    result = fast(radiance, albedo * 0.0 + 50.0, normal * 0.0).radiance
    assert np.isfinite(result).all()


# --- laws -----------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [1e-6, 1e-2, 1e6])
def test_brighter_in_is_brighter_out(fast: Upscaler, factor: float) -> None:
    radiance, albedo, normal = picture(24, 24)
    expected = fast(radiance, albedo, normal)
    result = fast(radiance * np.float32(factor), albedo, normal)
    np.testing.assert_allclose(result.radiance, expected.radiance * factor, rtol=1e-3)
    assert result.exposure * factor == pytest.approx(expected.exposure, rel=1e-5)


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_black_in_is_black_out(preset: str) -> None:
    _, albedo, normal = picture(8, 8)
    result = make(preset=preset)(np.zeros((8, 8, 3), np.float32), albedo, normal)
    assert result.exposure == 1.0
    assert not result.radiance.any()


def test_a_given_exposure_makes_a_border_of_the_frame(fast: Upscaler) -> None:
    radiance, albedo, normal = picture(96, 96)
    frame = fast(radiance, albedo, normal)
    border = fast(
        radiance[32:], albedo[64:], normal[64:], exposure=frame.exposure
    ).radiance
    inner = np.s_[-64:]  # what has seen its surroundings
    error = range_error(border[inner], frame.radiance[64:][inner], frame.exposure)
    assert error < 1e-3
    assert fast(radiance[32:], albedo[64:], normal[64:]).exposure != frame.exposure


def test_twice_is_the_same(fast: Upscaler) -> None:
    inputs = picture(20, 20)
    first, second = (fast(*inputs).radiance for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_the_callers_arrays_are_left_alone(fast: Upscaler) -> None:
    inputs = picture(8, 8)
    inputs[0][2, 2] = np.nan
    inputs[1][5, 5] = 50.0
    before = [x.copy() for x in inputs]
    fast(*inputs)
    for x, kept in zip(inputs, before, strict=True):
        np.testing.assert_array_equal(x, kept)


def test_half_the_digits_are_near_all_of_them() -> None:
    inputs = picture(24, 24)
    net = network()
    expected, result = (
        Upscaler(precision=precision, device="cpu", weights=net)(*inputs)
        for precision in ("fp32", "bf16")
    )
    assert not np.array_equal(result.radiance, expected.radiance)
    assert range_error(result.radiance, expected.radiance, expected.exposure) < 0.02


# --- tiles ----------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [2, 4])
def test_tiles_are_the_whole(scale: int) -> None:
    upscaler = make(scale)
    inputs = picture(200 // scale * 2, 144 // scale * 2, scale)
    whole = upscaler(*inputs)
    tiled = upscaler(*inputs, tile=128 * 2 // scale)
    assert whole.tiles == 1
    assert tiled.tiles > 1
    assert range_error(tiled.radiance, whole.radiance, whole.exposure) < 1e-3


def test_a_memory_limit_makes_tiles(fast: Upscaler) -> None:
    inputs = picture(260, 230)
    whole = fast(*inputs)
    tiled = fast(*inputs, memory_limit=0)
    assert whole.tiles == 1
    assert tiled.tiles == 4
    assert range_error(tiled.radiance, whole.radiance, whole.exposure) < 1e-3


MEASURE = """
import sys
import numpy as np
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler

def status(key):
    lines = open("/proc/self/status").read().splitlines()
    return 1024 * int(next(x for x in lines if x.startswith(key)).split()[1])

upscaler = Upscaler(device="cpu", weights=XRDS(preset_config("fast", 2)))
noise = np.random.default_rng(0).random
low, high = noise((320, 320, 3), np.float32), noise((640, 640, 3), np.float32)
upscaler(low[:8, :8], high[:16, :16], high[:16, :16])  # what is loaded once
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
result = upscaler(low, high, high, memory_limit=int(sys.argv[1])).radiance
print(status("VmHWM") - before - result.nbytes)
"""


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_memory_limit_is_kept() -> None:
    def peak(limit: int) -> int:
        command = [sys.executable, "-c", MEASURE, str(limit)]
        done = subprocess.run(command, capture_output=True, check=True, text=True)
        return int(done.stdout)

    limit = 100 << 20
    assert peak(limit) < limit < peak(limit * 100)


def test_the_brightest_tiles_are_blended_without_overflow(fast: Upscaler) -> None:
    sizes = ((250, 8), (500, 16), (500, 16))
    brightest = [np.full((*size, 3), 3.4e38, np.float32) for size in sizes]
    brightest[0][::2] = 3.3e38  # an even picture would need no network
    result = fast(*brightest, exposure=1e-36, tile=1)
    assert result.tiles > 1
    assert np.isfinite(result.radiance).all()
    assert result.radiance.max() > 1e38


def test_the_cost_per_pixel_is_that_of_larger_pictures(fast: Upscaler) -> None:
    values = 0

    def count(module: object, inputs: object, output: torch.Tensor) -> None:
        nonlocal values
        values += output.numel()

    hooks = [x.register_forward_hook(count) for x in upscaler_leaves(fast)]
    fast(*picture(64, 96))
    for hook in hooks:
        hook.remove()
    assert values / (128 * 192) == pytest.approx(fast.cost.values)
    assert 36 < fast.cost.bytes < 2000


def upscaler_leaves(upscaler: Upscaler) -> list[torch.nn.Module]:
    return [m for m in upscaler.network.modules() if not list(m.children())]


# --- progress -------------------------------------------------------------------------


@pytest.mark.parametrize("tile", [None, 1])
def test_progress_rises_to_exactly_one(fast: Upscaler, tile: int | None) -> None:
    fractions: list[float] = []
    fast(*picture(180, 60), tile=tile, progress=fractions.append)
    assert len(fractions) > 20
    assert fractions[0] == 0.0
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert fractions[-2] > 0.9
    assert all(0.0 <= x <= 1.0 for x in fractions)


def test_progress_of_a_black_picture(fast: Upscaler) -> None:
    fractions: list[float] = []
    fast(*(0.0 * x for x in picture(4, 4)), progress=fractions.append)
    assert fractions == [0.0, 1.0]


@pytest.mark.parametrize("limit", [0.0, 0.1, 0.5, 1.0])
def test_cancel(fast: Upscaler, limit: float) -> None:
    fractions: list[float] = []

    def stop(fraction: float) -> bool:
        fractions.append(fraction)
        return fraction < limit

    with pytest.raises(Cancelled):
        fast(*picture(16, 16), progress=stop)
    assert fractions[-1] >= limit
    assert all(x < limit for x in fractions[:-1])
    assert fast(*picture(4, 4)).radiance.any(), "unusable after a cancel"
    assert not any(m._forward_hooks for m in fast.network.modules())


# --- alpha ----------------------------------------------------------------------------


def disc(height: int, width: int) -> Array:
    """A soft-edged disc's coverage."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    distance = np.hypot(y - height / 2, x - width / 2)
    return np.clip(height / 3 - distance + 0.5, 0.0, 1.0).astype(np.float32)


def low_mean(x: Array, scale: int) -> Array:
    height, width = x.shape[0] // scale, x.shape[1] // scale
    blocks = x.reshape(height, scale, width, scale, -1).mean(axis=(1, 3))
    return np.ascontiguousarray(blocks, np.float32)


@pytest.mark.parametrize("with_guide", [True, False])
def test_an_even_colour_keeps_it_behind_alpha(with_guide: bool) -> None:
    scale, cover = 4, disc(160, 120)
    colour = np.asarray([4.0, 0.5, 0.02], np.float32)
    low = low_mean(np.dstack((cover[..., None] * colour, cover)), scale)
    albedo = textured(160, 120, 3, seed=4) * cover[..., None]
    guide = cover if with_guide else None
    result = make(scale)(low, albedo, albedo, guide_alpha=guide).radiance
    alpha = result[..., 3]
    edge = (alpha > 0.0) & (alpha < 1.0)
    assert edge.any()
    np.testing.assert_allclose(
        result[edge][:, :3], alpha[edge][:, None] * colour, rtol=1e-4, atol=1e-6
    )
    assert not result[alpha == 0.0].any()
    if with_guide:
        np.testing.assert_allclose(alpha, cover, atol=1e-5)
        assert ((alpha == 1.0) == (cover == 1.0)).all()


def test_light_without_cover_is_kept(fast: Upscaler) -> None:
    low = np.zeros((16, 16, 4), np.float32)
    low[4:12, 4:12, 0] = 2.0  # fire: light, no alpha
    guide = np.full((32, 32, 3), 0.5, np.float32)
    result = fast(low, guide, guide, guide_alpha=np.zeros((32, 32), np.float32))
    assert not result.radiance[..., 3].any()
    assert result.radiance[12:20, 12:20, 0].min() > 0.5


def test_bands_of_alpha_meet(fast: Upscaler, monkeypatch: pytest.MonkeyPatch) -> None:
    radiance, albedo, normal = picture(40, 20)
    low = np.dstack((radiance, textured(40, 20, 1, seed=7)))
    cover = textured(80, 40, 1, seed=8)[..., 0]
    expected = fast(low, albedo, normal, guide_alpha=cover).radiance
    monkeypatch.setattr("xrds_core.superres.alpha._BAND", 7)
    result = fast(low, albedo, normal, guide_alpha=cover).radiance
    np.testing.assert_array_equal(result, expected)


def test_alpha_of_the_guides_serves_a_picture_without(fast: Upscaler) -> None:
    radiance, albedo, normal = picture(10, 9)
    cover = disc(19, 17)
    result = fast(radiance, albedo[:19, :17], normal[:19, :17], guide_alpha=cover)
    np.testing.assert_allclose(result.radiance[..., 3], cover, atol=1e-6)


# --- the one-line call ----------------------------------------------------------------


def test_upscale_uses_shipped_presets(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    monkeypatch.setattr(weights, "DIRECTORY", tmp_path)
    save_network(network(4), f"{tmp_path}/fast_x4.safetensors", {})
    inputs = picture(6, 5, 4)
    upscaler._get_upscaler.cache_clear()
    fractions: list[float] = []
    result = upscale(*inputs, scale=4, exposure=0.5, progress=fractions.append)
    again = upscale(*inputs, scale=4, exposure=0.5)
    assert result.shape == (24, 20, 3)
    np.testing.assert_array_equal(result, again)
    assert fractions[-1] == 1.0
    assert upscaler._get_upscaler.cache_info().hits == 1
    with pytest.raises(WeightsError, match="it holds: fast_x4"):
        upscale(*inputs, scale=4, preset="balanced")
