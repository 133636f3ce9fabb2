"""Decibels of a small golden scene at each scale must not fall.

`golden.json` holds what each series of Blender gave: `--record-decibels` writes what
they are now. The scene is the demo's still life; the reference is Cycles' own picture
of many samples, of the same Blender.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender import render
from xrds_core.superres import inputs, upscaler
from xrds_lab.demo import scene as demo
from xrds_lab.metrics import psnr

RECORD = Path(__file__).with_name("golden.json")
SCALES = [pytest.param(x, marks=[pytest.mark.nightly] * (x > 2)) for x in (2, 4, 8)]
SERIES = ".".join(map(str, bpy.app.version[:2]))
SIZE = 128, 80
SAMPLES = {1: 4, 2: 16, 4: 16, 8: 16}
REFERENCE_SAMPLES = 64
BOUND = 0.1  # dB

Decibels = Callable[..., float]


@pytest.fixture(scope="module")
def decibels() -> Decibels:
    """PSNR (dB) of a render at a scale, against the reference."""
    scene = demo.build(*SIZE)
    scene.cycles.use_denoising = False
    reference = render(scene, plain=True, samples=REFERENCE_SAMPLES, seed=7).radiance

    def measure(scale: int, **choices: Any) -> float:
        picture = render(scene, scale, samples=SAMPLES[scale], seed=1, **choices)
        return psnr(picture.radiance, reference, scene.view_settings.exposure)

    return measure


def recorded() -> dict[str, dict[str, float]]:
    return json.loads(RECORD.read_text("utf-8"))


@pytest.mark.parametrize("scale", [1, *SCALES])
def test_decibels_do_not_fall(
    scale: int, decibels: Decibels, pytestconfig: pytest.Config
) -> None:
    found, known = decibels(scale), recorded()
    if pytestconfig.getoption("--record-decibels"):
        known.setdefault(SERIES, {})[str(scale)] = round(found, 2)
        RECORD.write_text(json.dumps(known, indent=1) + "\n", "utf-8")
    if SERIES not in known:
        pytest.skip(f"nothing is recorded of Blender {SERIES}: --record-decibels")
    golden = known[SERIES][str(scale)]
    assert found >= golden - BOUND
    assert found <= golden + BOUND, "better: hold it with --record-decibels"


def brightened(monkeypatch: pytest.MonkeyPatch) -> None:
    """The way back from the logarithm is off by a tenth."""
    back = upscaler.inverse_transfer
    monkeypatch.setattr(upscaler, "inverse_transfer", lambda t, e: back(t, e) * 1.1)


def shifted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Guides lie a pixel beside the picture."""

    def fill(x: np.ndarray) -> tuple[np.ndarray, int]:
        return np.roll(x, 1, axis=1), 0

    monkeypatch.setattr(inputs, "fill_holes", fill)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("fault", [brightened, shifted])
def test_a_broken_front_end_is_seen(
    fault: Callable[[pytest.MonkeyPatch], None],
    scale: int,
    decibels: Decibels,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = decibels(scale)
    fault(monkeypatch)
    assert decibels(scale) < whole - BOUND


def test_a_worse_denoiser_is_seen(decibels: Decibels) -> None:
    assert decibels(1, denoise="fast") < decibels(1) - BOUND
