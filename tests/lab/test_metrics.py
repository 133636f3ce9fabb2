"""Errors between pictures, against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_core.arrays import Array
from xrds_core.errors import PictureError
from xrds_lab import metrics

RANDOM = np.random.default_rng(5)
REFERENCE = RANDOM.uniform(0, 1, (20, 24, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("linear", "stops", "shown"),
    [
        (0.0, 0, 0.0),
        (1.0, 0, 1.0),
        (-3.0, 0, 0.0),
        (7.0, 0, 1.0),
        (0.002, 0, 0.02584),
        (0.5, 0, 0.735357),
        (0.25, 1, 0.735357),
        (1.0, -1, 0.735357),
    ],
)
def test_srgb_curve_at_known_points(linear: float, stops: float, shown: float) -> None:
    pixel = np.full((1, 1, 3), linear, np.float32)
    assert metrics.to_srgb(pixel, stops) == pytest.approx(shown, abs=1e-6)


def test_psnr_of_a_constant_display_offset() -> None:
    # 0.5 linear is 0.735357 on the display, so the error against white is known
    half, white = (np.full((8, 8, 3), v, np.float32) for v in (0.5, 1.0))
    expected = -20 * np.log10(1 - 0.735357)
    assert metrics.psnr(half, white) == pytest.approx(expected, abs=1e-4)
    assert metrics.psnr(half, white, exposure=1) == float("inf")


def test_psnr_ignores_what_the_display_clips() -> None:
    brighter = np.where(REFERENCE > 0.9, 5.0, REFERENCE).astype(np.float32)
    clipped = np.where(REFERENCE > 0.9, 1.0, REFERENCE).astype(np.float32)
    assert metrics.psnr(brighter, clipped) == float("inf")


def test_relmse_by_hand() -> None:
    reference = np.full((10, 10, 3), 2.0, np.float32)
    assert metrics.relmse(reference + 1, reference) == pytest.approx(1 / 4.01)


def test_relmse_trims_the_worst_pixels_alone() -> None:
    reference = np.full((50, 40, 3), 1.0, np.float32)
    picture = reference + 0.1
    picture[:1, :2] = 1000  # 2 of 2000 pixels are 0.1 %
    assert metrics.relmse(picture, reference) > 900
    trimmed = metrics.relmse(picture, reference, metrics.TRIMMED_FRACTION)
    assert trimmed == pytest.approx(0.01 / 1.01, rel=1e-4)


def test_flip_is_zero_for_equal_and_grows_with_the_error() -> None:
    pytest.importorskip("flip_evaluator")
    little, much = (
        np.clip(REFERENCE + RANDOM.normal(0, s, REFERENCE.shape), 0, 1).astype("f4")
        for s in (0.01, 0.1)
    )
    assert metrics.flip(REFERENCE, REFERENCE) == 0
    small = metrics.flip(little, REFERENCE)
    assert 0 < small < metrics.flip(much, REFERENCE) < 1


def test_black_against_white_is_the_largest_flip() -> None:
    pytest.importorskip("flip_evaluator")
    black, white = (np.full((16, 16, 3), v, np.float32) for v in (0.0, 1.0))
    assert metrics.flip(black, white) > 0.9


def test_the_standard_row_agrees_with_its_parts() -> None:
    pytest.importorskip("flip_evaluator")
    picture = REFERENCE * np.float32(0.9)
    row = metrics.all_metrics(picture, REFERENCE, 0.5)
    assert set(row) == {"psnr", "relmse", "relmse_trimmed", "flip"}
    assert row["psnr"] == metrics.psnr(picture, REFERENCE, 0.5)
    assert row["flip"] == metrics.flip(picture, REFERENCE, 0.5)
    assert 0 < row["relmse_trimmed"] <= row["relmse"]


@pytest.mark.parametrize("measure", [metrics.psnr, metrics.relmse])
def test_bad_arrays_are_named(measure) -> None:  # noqa: ANN001
    with pytest.raises(PictureError, match=r"\(20, 23, 3\)"):
        measure(REFERENCE[:, 1:], REFERENCE)
    with pytest.raises(PictureError, match="3\\)"):
        measure(REFERENCE[..., :2], REFERENCE[..., :2])
    broken = REFERENCE.copy()
    broken[3, 4, 1] = np.nan
    with pytest.raises(PictureError, match="1 values of the picture"):
        measure(broken, REFERENCE)
    with pytest.raises(PictureError, match="reference"):
        measure(REFERENCE, broken)


def test_two_references_tell_an_error_without_their_noise() -> None:
    rng = np.random.default_rng(5)
    true = rng.uniform(0.2, 0.6, (96, 96, 3)).astype(np.float32)

    def noisy(size: float) -> Array:
        return true + rng.normal(0, size, true.shape).astype(np.float32)

    picture, pair = noisy(0.01), (noisy(0.03), noisy(0.03))
    same = metrics.metrics_of_pair(picture, (true, true), true)
    assert same == pytest.approx(metrics.all_metrics(picture, true))
    found = metrics.metrics_of_pair(picture, pair, true)
    assert found["psnr"] == pytest.approx(same["psnr"], abs=0.5)
    assert found["relmse"] == pytest.approx(same["relmse"], rel=0.15)
    assert metrics.psnr(picture, (pair[0] + pair[1]) / 2) < same["psnr"] - 3.0
    perfect = metrics.metrics_of_pair(true, (true, true), true)
    assert perfect["psnr"] == pytest.approx(70.0)
