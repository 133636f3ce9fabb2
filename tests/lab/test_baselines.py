"""Enlargements without a network: alignment, energy, and edges under guides."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_core.errors import PictureError
from xrds_lab import baselines


def area_mean(picture: np.ndarray, scale: int) -> np.ndarray:
    height, width, channels = picture.shape
    blocks = picture.reshape(height // scale, scale, width // scale, scale, channels)
    return blocks.mean(axis=(1, 3))


def ramp(height: int, width: int) -> np.ndarray:
    """Linear in x and y, so that every aligned enlargement restores it inside."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    return np.stack([x, y, x + 2 * y], axis=-1) / 64


@pytest.mark.parametrize("scale", [2, 4, 8])
def test_bicubic_restores_a_ramp(scale: int) -> None:
    full = ramp(64, 96)
    large = baselines.bicubic(area_mean(full, scale), scale)
    inner = slice(3 * scale, -3 * scale)
    np.testing.assert_allclose(large[inner, inner], full[inner, inner], atol=1e-5)


def test_bicubic_is_never_negative() -> None:
    spike = np.zeros((8, 8, 3), np.float32)
    spike[4, 4] = 100
    assert baselines.bicubic(spike, 4).min() == 0


@pytest.mark.parametrize("scale", [2, 4])
def test_joint_bilateral_is_centred(scale: int) -> None:
    full = ramp(48, 64)
    flat = np.full(full.shape, 0.5, np.float32)
    large = baselines.joint_bilateral(area_mean(full, scale), flat, flat, scale)
    inner = slice(3 * scale, -3 * scale)
    # a wide kernel: within a block it may flatten the ramp, but never shift it
    blocks = area_mean(large, scale)[3:-3, 3:-3]
    np.testing.assert_allclose(blocks, area_mean(full[inner, inner], scale), atol=2e-3)


def test_joint_bilateral_keeps_an_edge_that_the_guides_show() -> None:
    scale, edge = 4, 22  # inside a low-resolution pixel
    full = np.full((32, 48, 3), 0.1, np.float32)
    full[:, edge:] = 2.0
    albedo = np.where(full > 1, 0.9, 0.1).astype(np.float32)
    normal = np.zeros_like(full)
    low = area_mean(full, scale)
    guided = baselines.joint_bilateral(low, albedo, normal, scale)
    assert np.abs(guided - full).max() < 0.1
    assert np.abs(baselines.bicubic(low, scale) - full).max() > 0.5


def test_joint_bilateral_stays_finite_where_no_neighbour_resembles() -> None:
    random = np.random.default_rng(3)
    low = random.uniform(0, 1, (6, 8, 3)).astype(np.float32)
    albedo, normal = random.uniform(-9, 9, (2, 24, 32, 3)).astype(np.float32)
    large = baselines.joint_bilateral(low, albedo, normal, 4)
    assert np.isfinite(large).all()
    assert low.min() - 1e-6 <= large.min()
    assert large.max() <= low.max() + 1e-6


def test_guides_of_another_size_are_refused() -> None:
    low, guide = np.zeros((6, 8, 3), "f4"), np.zeros((24, 30, 3), "f4")
    with pytest.raises(PictureError, match="8x6 picture at scale 4"):
        baselines.joint_bilateral(low, guide, guide, 4)
