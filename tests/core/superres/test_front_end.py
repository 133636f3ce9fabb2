from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from xrds_core.arrays import Array
from xrds_core.superres import front_end
from xrds_core.superres.front_end import (
    area_mean,
    auto_exposure,
    clean_albedo,
    clean_normal,
    clean_radiance,
    demodulated_base,
    inverse_transfer,
    regressed_base,
    transfer,
    upsample_alpha,
    upsample_bilinear,
)

Clean = Callable[[Array], tuple[Array, int]]


def random_picture(height: int, width: int, seed: int = 0) -> Array:
    generator = np.random.default_rng(seed)
    return generator.random((height, width, 3), dtype=np.float32)


# --- clean-up -------------------------------------------------------------------------


@pytest.mark.parametrize("clean", [clean_radiance, clean_albedo, clean_normal])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_bad_pixels_take_the_mean_of_finite_neighbours(
    clean: Clean, bad: float
) -> None:
    x = np.full((9, 7, 3), 0.25, np.float32)
    x[0, 0, 1] = x[4, 5, 2] = x[8, 6, 0] = bad  # one channel spoils a pixel
    cleaned, count = clean(x)
    assert count == 3
    assert np.array_equal(cleaned, np.full_like(x, 0.25))
    assert not np.isfinite(x[4, 5, 2]), "the caller's array was changed"


def test_bad_pixels_leave_all_others_bit_for_bit() -> None:
    x = random_picture(33, 17)
    spoilt = x.copy()
    spoilt[10:20, 5:9] = np.nan
    cleaned, count = clean_radiance(spoilt)
    good = np.isfinite(spoilt).all(axis=-1)
    assert count == 40
    assert np.array_equal(cleaned[good], x[good])
    assert x.min() <= cleaned.min()
    assert cleaned.max() <= x.max()


def test_large_holes_are_filled_from_their_rim() -> None:
    x = np.full((64, 64, 3), 3e38, np.float32)  # sums of four would overflow
    x[8:60, 3:64] = np.inf
    cleaned, _ = clean_radiance(x)
    np.testing.assert_allclose(cleaned, 3e38, rtol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3)])
def test_a_picture_without_a_finite_pixel_becomes_black(shape: tuple[int, ...]) -> None:
    cleaned, count = clean_radiance(np.full(shape, np.nan, np.float32))
    assert count == shape[0] * shape[1]
    assert not cleaned.any()


def test_negative_radiance_becomes_black_and_is_counted() -> None:
    x = random_picture(4, 4)
    x[1, 2] = (-100.0, 0.5, -1e-9)
    cleaned, count = clean_radiance(x)
    assert count == 1
    assert cleaned[1, 2].tolist() == [0.0, 0.5, 0.0]


def test_clean_radiance_is_returned_as_it_is() -> None:
    x = random_picture(4, 4)
    assert clean_radiance(x)[0] is x


def test_guides_are_bounded_and_zero_normals_stay_zero() -> None:
    x = np.asarray([[[50.0, -2.0, 0.5], [0.0, 0.0, 0.0]]], np.float32)
    assert clean_albedo(x)[0].tolist() == [[[1.0, 0.0, 0.5], [0.0, 0.0, 0.0]]]
    assert clean_normal(x)[0].tolist() == [[[1.0, -1.0, 0.5], [0.0, 0.0, 0.0]]]


# --- exposure -------------------------------------------------------------------------


def test_exposure_brings_a_grey_picture_to_the_key() -> None:
    grey = np.full((40, 30, 3), 4.0, np.float32)
    assert auto_exposure(grey) == pytest.approx(0.18 / 4.0)


def test_exposure_is_the_geometric_mean_of_bins() -> None:
    x = np.ones((32, 32, 3), np.float32)
    x[:16] = 100.0
    assert auto_exposure(x) == pytest.approx(0.18 / 10.0)


def test_exposure_leaves_out_bins_that_are_next_to_black() -> None:
    x = np.ones((32, 32, 3), np.float32)
    x[:, :16] = 0.9e-4
    assert auto_exposure(x) == pytest.approx(0.18)
    x[:, :16] = 1.1e-4
    assert auto_exposure(x) == pytest.approx(0.18 / np.sqrt(1.1e-4))


@pytest.mark.parametrize("value", [1e5, 1e8, 1e30])
def test_a_few_fireflies_leave_the_exposure_nearly_alone(value: float) -> None:
    x = random_picture(64, 64)
    expected = auto_exposure(x)
    x[[5, 20, 40, 60], [7, 50, 33, 10]] = value
    assert auto_exposure(x) == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e6])
def test_exposure_is_inverse_to_brightness(factor: float) -> None:
    x = random_picture(21, 50)
    bright = auto_exposure(x * np.float32(factor))
    assert bright * factor == pytest.approx(auto_exposure(x), rel=1e-5)


def test_a_tiny_render_gives_the_exposure_of_the_frame() -> None:
    frame = random_picture(128, 256) ** 4
    tiny = frame.reshape(32, 4, 64, 4, 3).mean(axis=(1, 3))
    assert auto_exposure(tiny) == pytest.approx(auto_exposure(frame), rel=1e-5)


@pytest.mark.parametrize("value", [0.0, 1e-45, 1e-38, 3.4e38])
def test_exposure_stays_a_normal_float(value: float) -> None:
    exposure = auto_exposure(np.full((5, 3, 3), value, np.float32))
    exposed = np.float32(front_end.TRANSFER_GAIN * exposure)
    assert np.finfo(np.float32).tiny <= exposed < np.inf
    assert value > 0.0 or exposure == 1.0


# --- transfer -------------------------------------------------------------------------


@pytest.mark.parametrize("exposure", [1e-6, 1.0, 1e6])
def test_transfer_has_an_inverse(exposure: float) -> None:
    x = (np.logspace(-6, 6, 200, dtype=np.float32) / np.float32(exposure))[:, None]
    back = inverse_transfer(transfer(x, exposure), exposure)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, x, rtol=1e-5)


def test_transfer_of_arrays_and_tensors_is_one() -> None:
    x = random_picture(5, 4) * 100.0
    t = transfer(x, 0.3)
    np.testing.assert_allclose(transfer(torch.from_numpy(x), 0.3).numpy(), t, rtol=1e-6)
    back = inverse_transfer(torch.from_numpy(t), 0.3)
    np.testing.assert_allclose(back.numpy(), inverse_transfer(t, 0.3), rtol=1e-6)


def test_transfer_takes_one_exposure_a_picture() -> None:
    x = torch.ones(2, 3, 4, 5)
    t = transfer(x, torch.tensor([0.1, 0.2]).view(2, 1, 1, 1))
    np.testing.assert_allclose(t[:, 0, 0, 0], np.log1p([1.0, 2.0]), rtol=1e-6)


@pytest.mark.parametrize("exposure", [1e-36, 1.0, 1e36])
def test_transfer_is_finite_both_ways(exposure: float) -> None:
    x = np.asarray([0.0, 1e-40, 65504.0, 65505.0, 3.4e38], np.float32)
    for values in (x, torch.from_numpy(x)):
        t = transfer(values, exposure)
        assert np.isfinite(np.asarray(t)).all()
        assert np.isfinite(np.asarray(inverse_transfer(t + 50.0, exposure))).all()


def test_transfer_of_half_precision_is_computed_in_float32() -> None:
    x = torch.tensor([60000.0], dtype=torch.float16)
    assert transfer(x, 10.0).dtype == torch.float32
    assert transfer(x, 10.0).item() == pytest.approx(np.log1p(6e6), rel=1e-3)


# --- resampling -----------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1, 2, 4, 8])
def test_upsampling_keeps_ramps_inside_and_holds_edges(scale: int) -> None:
    ramp = torch.arange(6.0).view(1, 1, 1, 6).expand(1, 1, 2, 6)
    large = upsample_bilinear(ramp, scale)[0, 0, 0].numpy()
    centres = (np.arange(6 * scale) + 0.5) / scale - 0.5
    np.testing.assert_allclose(large, np.clip(centres, 0, 5), atol=1e-6)


def test_area_mean_is_the_mean_of_blocks() -> None:
    x = torch.arange(16.0).view(1, 1, 4, 4)
    assert area_mean(x, 2)[0, 0].tolist() == [[2.5, 4.5], [10.5, 12.5]]


def test_demodulated_base_restores_texture_under_even_light() -> None:
    albedo = random_picture(24, 40)
    lit = 3.0 * (albedo + front_end.ALBEDO_EPSILON)
    low = lit.reshape(6, 4, 10, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(demodulated_base(low, albedo, 4), lit, rtol=1e-5)


@pytest.mark.parametrize("scale", [2, 4, 8])
def test_demodulated_base_keeps_the_mean_of_smooth_pictures(scale: int) -> None:
    rows, columns = np.mgrid[0 : 16 * scale, 0 : 24 * scale] / scale
    light = 2.0 + np.sin(rows / 4.0) * np.cos(columns / 5.0)
    albedo = 0.5 + 0.3 * np.sin(columns / 3.0 + rows / 6.0)
    truth = np.repeat((light * albedo)[..., None], 3, axis=-1).astype(np.float32)
    low = truth.reshape(16, scale, 24, scale, 3).mean(axis=(1, 3))
    guide = np.repeat(albedo[..., None], 3, axis=-1).astype(np.float32)
    base = demodulated_base(low, guide, scale)
    assert base.mean() == pytest.approx(float(truth.mean()), rel=0.01)


def test_regressed_base_keeps_texture_and_leaves_what_guides_do_not_say() -> None:
    albedo, normal = random_picture(48, 64), np.zeros((48, 64, 3), np.float32)
    lit = 3.0 * (albedo + front_end.ALBEDO_EPSILON)
    low = lit.reshape(12, 4, 16, 4, 3).mean(axis=(1, 3))
    plain = low.repeat(4, axis=0).repeat(4, axis=1)
    error = np.abs(regressed_base(low, low, albedo, normal, 4) - lit).mean()
    assert error < 0.3 * np.abs(plain - lit).mean()
    even = np.full((12, 16, 3), 0.7, np.float32)
    base = regressed_base(even, even, albedo, normal, 4)
    np.testing.assert_allclose(base, 0.7, rtol=1e-3)
    brighter = regressed_base(low * 1e6, low * 1e6, albedo, normal, 4)
    np.testing.assert_allclose(
        brighter, regressed_base(low, low, albedo, normal, 4) * 1e6, rtol=1e-4
    )


# --- alpha ----------------------------------------------------------------------------


def test_alpha_is_exact_where_low_and_guide_agree() -> None:
    guide = np.zeros((16, 16), np.float32)
    guide[:, 6:] = 1.0
    guide[:, 5] = 0.4  # noisy edge
    low = guide.reshape(4, 4, 4, 4).mean(axis=(1, 3))
    low[:, 1] = 0.8  # the picture's own samples see more of the edge
    alpha = upsample_alpha(low, guide, 4)
    assert (alpha[:, :4] == 0.0).all()
    assert (alpha[:, 8:] == 1.0).all()
    assert ((alpha >= 0.0) & (alpha <= 1.0)).all()
    assert alpha[:, 5].min() > 0.4


def test_alpha_of_a_perfect_guide_is_the_guide() -> None:
    guide = np.round(random_picture(20, 30)[..., 0] * 4) / 4
    low = guide.reshape(10, 2, 15, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(upsample_alpha(low, guide, 2), guide, atol=1e-6)


def test_alpha_takes_sizes_that_the_scale_does_not_divide() -> None:
    assert (
        upsample_alpha(
            np.ones((2, 2), np.float32), np.ones((7, 5), np.float32), 4
        ).tolist()
        == np.ones((7, 5)).tolist()
    )
