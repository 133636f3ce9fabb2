"""Training windows small enough to train on in a test."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from xrds_lab.training.config import TrainingConfig
from xrds_lab.training.data import Variation

SIZE = 32
TINY = {"channels": 8, "guide_channels": 8, "window_size": 4, "tail_channels": 4}
WriteWindow = Callable[..., None]


@pytest.fixture(scope="session")
def full_variation() -> Variation:
    """Every kind of variation, often."""
    return Variation(
        noisy=0.3,
        exposure_stops=1,
        tint_stops=0.5,
        rotated_normals=0.2,
        black=0.1,
        shaded=0.3,
        over_denoised=0.5,
        symmetries=True,
        padded=0.5,
    )


@pytest.fixture(scope="session")
def write_window() -> WriteWindow:
    """Writes a window whose reference is its albedo under one light."""

    def write(path: Path, seed: int, scale: int = 2) -> None:
        random = np.random.default_rng(seed)
        albedo = random.uniform(0.1, 1, (SIZE, SIZE, 3))
        normal = random.uniform(-1, 1, (SIZE, SIZE, 3))
        reference = 2 * albedo
        half = SIZE // scale
        low = reference.reshape(half, scale, half, scale, 3).mean((1, 3))
        guides = np.concatenate((albedo, normal), axis=-1)
        arrays = {"reference": reference, "guides_a": guides, "guides_b": guides}
        for i in (0, 1):
            arrays |= {f"low{scale}_{i}": low, f"low{scale}_{i}_noisy": low}
        meta = {"guide_spp": [1, 4], "blender_series": "4.5"}
        path.parent.mkdir(parents=True, exist_ok=True)
        half_floats = {k: v.astype(np.float16) for k, v in arrays.items()}
        np.savez_compressed(path, meta=json.dumps(meta), **half_floats)

    return write


@pytest.fixture
def blend(tmp_path: Path, still_life: Callable[..., Any]) -> Path:
    """A file of a few cubes, to make shots of."""
    import bpy

    still_life()
    path = tmp_path / "cubes.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def config(
    tmp_path: Path, write_window: WriteWindow, full_variation: Variation
) -> TrainingConfig:
    """A run of six steps on three windows, validated on another one."""
    for seed in range(4):
        split = "validation" if seed == 3 else "train"
        write_window(tmp_path / "data" / split / f"{seed}.npz", seed)
    return TrainingConfig(
        data=(str(tmp_path / "data"),),
        network=TINY,
        steps=6,
        batch=2,
        crop=16,
        warmup=2,
        validate_every=3,
        variation=full_variation,
    )
