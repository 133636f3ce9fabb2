"""Laws of the front end and of tiling, over whatever values hypothesis finds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from xrds_core.arrays import Array
from xrds_core.superres.front_end import (
    TRANSFER_GAIN,
    area_mean,
    auto_exposure,
    clean_albedo,
    clean_normal,
    clean_radiance,
    demodulated_base,
    inverse_transfer,
    transfer,
    upsample_alpha,
)
from xrds_core.superres.tiling import fit, tiles

settings.register_profile("laws", max_examples=30, deadline=None, derandomize=True)
settings.load_profile("laws")

TINY = float(np.finfo(np.float32).tiny)
LARGEST = 3.3e38
LARGEST_EXPOSED = 1e18
exposures = st.floats(1e-30, 1e30)
any_float = st.floats(width=32)
light = st.floats(0.0, 2.0**100, width=32)
unit = st.floats(0.0, 1.0, width=32)
lengths = st.integers(1, 400)


def pictures(values: Any, channels: int = 3, side: int = 9) -> Any:
    shapes = array_shapes(min_dims=2, max_dims=2, max_side=side)
    return shapes.flatmap(
        lambda shape: arrays(np.float32, (*shape, channels), elements=values)
    )


# --- transfer -------------------------------------------------------------------------


@given(st.floats(1e-6, 1e17), exposures)
def test_transfer_comes_back(exposed: float, exposure: float) -> None:
    x = np.float32(min(exposed / TRANSFER_GAIN / exposure, LARGEST))
    back = inverse_transfer(transfer(np.asarray([x]), exposure), exposure)[0]
    if TINY < x < LARGEST:
        # log1p of values near 1e17 is 40: float32 holds it to 4e-6, and so expm1
        assert math.isclose(back, x, rel_tol=1e-5)


@given(light, light, exposures)
def test_transfer_keeps_the_order_and_its_bounds(
    a: float, b: float, exposure: float
) -> None:
    low, high = transfer(np.asarray(sorted((a, b)), np.float32), exposure)
    assert 0.0 <= low <= high <= math.log1p(LARGEST_EXPOSED) * 1.0001


@given(any_float, exposures)
@example(89.0, 1e-30)
def test_inverse_transfer_is_finite_for_every_finite_value(
    t: float, exposure: float
) -> None:
    back = inverse_transfer(np.asarray([t], np.float32), exposure)[0]
    assert np.isfinite(back) == (t == t and t != math.inf) or back <= 3.4e38  # noqa: PLR0124  # NaN


@given(arrays(np.float32, (1, 3, 4, 4), elements=light), exposures)
def test_arrays_and_tensors_are_transferred_alike(x: Array, exposure: float) -> None:
    np.testing.assert_allclose(
        transfer(torch.from_numpy(x), exposure).numpy(),
        transfer(x, exposure),
        rtol=1e-5,
        atol=1e-30,
    )


# --- clean-up and exposure ------------------------------------------------------------


@given(pictures(any_float))
def test_cleaned_pictures_are_bounded_and_clean_again(x: Array) -> None:
    for clean, least, most in (
        (clean_radiance, 0.0, np.inf),
        (clean_albedo, 0.0, 1.0),
        (clean_normal, -1.0, 1.0),
    ):
        once, bad = clean(x)
        assert once.shape == x.shape
        assert np.isfinite(once).all()
        assert least <= once.min()
        assert once.max() <= most
        assert 0 <= bad <= x.shape[0] * x.shape[1]
        again, none = clean(once)
        assert none == 0
        np.testing.assert_array_equal(again, once)


@given(pictures(st.floats(2.0**-60, 2.0**60, width=32)), st.integers(-40, 40))
def test_exposure_falls_as_light_rises(x: Array, power: int) -> None:
    exposure = auto_exposure(x)
    assert math.isfinite(exposure)
    assert exposure > 0.0
    brighter = auto_exposure(x * np.float32(2.0**power))
    assert math.isclose(brighter * 2.0**power, exposure, rel_tol=1e-4)


# --- demodulation ---------------------------------------------------------------------


@given(
    arrays(np.float32, (4, 3, 3), elements=st.floats(0.0, 2.0**60, width=32)),
    arrays(np.float32, (8, 6, 3), elements=unit),
)
def test_demodulation_neither_darkens_below_zero_nor_leaves_its_bounds(
    radiance: Array, albedo: Array
) -> None:
    base = demodulated_base(radiance, albedo, 2)
    assert base.shape == albedo.shape
    assert base.min() >= 0.0
    # a pixel's albedo over the mean of its block is at most scale², its lights convex
    assert base.max() <= 51 * radiance.max() * 1.0001


@given(unit, arrays(np.float32, (8, 6, 3), elements=unit))
def test_even_light_on_any_albedo_comes_back(lamp: float, albedo: Array) -> None:
    guide = albedo + 0.02
    planes = torch.from_numpy(guide.transpose(2, 0, 1))[None]
    low = area_mean(planes, 2)[0].numpy().transpose(1, 2, 0) * np.float32(lamp)
    np.testing.assert_allclose(
        demodulated_base(low, albedo, 2), guide * np.float32(lamp), rtol=1e-4, atol=1e-7
    )


@given(
    arrays(np.float32, (3, 4), elements=unit), arrays(np.float32, (6, 8), elements=unit)
)
def test_alpha_is_coverage(low: Array, guide: Array) -> None:
    alpha = upsample_alpha(low, guide, 2)
    assert alpha.min() >= 0.0
    assert alpha.max() <= 1.0


# --- tiling ---------------------------------------------------------------------------


@given(
    lengths,
    lengths,
    st.integers(0, 300),
    st.integers(0, 48),
    st.sampled_from([8, 16, 32]),
)
def test_tiles_cover_every_pixel_once(
    height: int, width: int, side: int, overlap: int, multiple: int
) -> None:
    total = np.zeros((height, width))
    for tile in tiles(height, width, (side, side), overlap, multiple):
        rows, columns = tile.rows, tile.columns
        assert rows.start % multiple == columns.start % multiple == 0
        assert 0 <= rows.start < rows.stop <= height
        total[rows.start : rows.stop, columns.start : columns.stop] += tile.weights(1)
    np.testing.assert_allclose(total, 1.0, atol=1e-5)


@given(lengths, lengths, st.floats(0, 1e6), st.floats(1.0, 8.0))
def test_more_memory_never_means_more_tiles(
    height: int, width: int, pixels: float, factor: float
) -> None:
    few, many = (
        len(tiles(height, width, fit(height, width, p, 32, 16), 32, 16))
        for p in (pixels * factor, pixels)
    )
    assert few <= many
