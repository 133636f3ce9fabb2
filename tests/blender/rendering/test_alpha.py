"""Alpha above scale 1: that of four guide samples, without their noise."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender import render, run_job
from xrds_blender.cycles.low_resolution import Guides
from xrds_blender.planning.request import Machine
from xrds_blender.rendering import loading
from xrds_blender.rendering.enlarging import clean_alpha

SIDE = 96


def scene() -> np.ndarray:
    """A disc's exact alpha, and a veil of 0.4 beside it."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    alpha = np.clip(30.5 - np.hypot(x - 40, y - 45), 0.0, 1.0)
    alpha[8:80, 76:92] = 0.4
    return alpha.astype(np.float32)


def guides_of(alpha: np.ndarray, samples: int | None = 4) -> Guides:
    hits = np.random.default_rng(1).binomial(samples or 1, alpha) / (samples or 1)
    nothing = np.zeros((*alpha.shape, 3), np.float32)
    noisy = hits.astype(np.float32) if samples else alpha
    return Guides(nothing, nothing, noisy, None, samples)


def error(alpha: np.ndarray) -> float:
    return float(np.sqrt(np.mean((alpha - scene()) ** 2)))


def test_noise_goes_and_edges_stay() -> None:
    guides = guides_of(scene())
    found = clean_alpha(guides, Machine())
    assert found.dtype == np.float32
    assert error(found) < 0.6 * error(guides.alpha)
    assert 0.0 <= found.min() <= found.max() <= 1.0
    inside, outside = found[30:60, 25:55], found[85:, :70]
    assert (inside == 1.0).all()
    assert (outside == 0.0).all()


@pytest.mark.parametrize("alpha", [np.ones((8, 8), np.float32), scene()])
def test_what_has_no_noise_stays_as_it_is(alpha: np.ndarray) -> None:
    samples = 4 if alpha.min() == 1.0 else None
    guides = guides_of(alpha, samples)
    assert clean_alpha(guides, Machine()) is guides.alpha


def test_the_network_gets_it(life: Any, network: Any) -> None:
    """Of four samples alpha is in quarters, but for Cycles' pixel filter."""
    life.render.film_transparent = True
    bpy.data.objects["Floor"].hide_render = True
    raw = run_job(life, lambda passes: passes.guides(4, seed=1)).alpha
    render(life, 2, seed=0)
    (call,) = network[0].calls
    assert np.abs(call["guide_alpha"] - raw).max() > 0.0
    np.testing.assert_array_equal(
        call["guide_alpha"], clean_alpha(guides_like(raw), Machine())
    )


def guides_like(alpha: np.ndarray) -> Guides:
    nothing = np.zeros((*alpha.shape, 3), np.float32)
    return Guides(nothing, nothing, alpha, None, 4)


def test_without_the_library_it_stays_as_it_is(monkeypatch: Any) -> None:
    loading._open_denoiser.cache_clear()
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    guides = guides_of(scene())
    assert clean_alpha(guides, Machine()) is guides.alpha
