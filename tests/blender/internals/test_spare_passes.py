"""Passes that nobody asked for: rendered, and not in the file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")

from xrds_blender.internals import spare_passes


@pytest.fixture(params=[False, True])
def stereo(request: pytest.FixtureRequest) -> bool:
    return request.param


@pytest.fixture
def multilayer(life: Any, tmp_path: Path, stereo: bool) -> Any:
    settings = life.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    life.cycles.use_denoising = False
    life.render.filepath = str(tmp_path / "frame.exr")
    life.render.use_multiview = stereo

    def render(engine: str, way: str) -> dict[str, np.ndarray]:
        life.render.engine, life.xrds.mode = engine, way
        bpy.ops.render.render(write_still=True)
        (path,) = tmp_path.glob("*_L.exr") if stereo else tmp_path.glob("*.exr")
        return read_channels(path)

    return render


@pytest.mark.parametrize("way", ["x2", "full_size"])
def test_a_file_has_the_passes_that_cycles_gives(
    life: Any, multilayer: Any, network: Any, way: str
) -> None:
    life.view_layers[0].use_pass_uv = True
    own, ours = multilayer("CYCLES", way), multilayer("XRDS", way)
    assert set(ours) == set(own)
    asked = life.view_layers[0].cycles
    asked.denoising_store_passes = True
    assert any("Denoising Albedo" in name for name in multilayer("XRDS", way))


def test_an_animation_leaves_none_either(life: Any, tmp_path: Path) -> None:
    """Depth and Vector are rendered for the neighbours' sake."""
    settings = life.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    life.render.engine, life.xrds.mode = "XRDS", "full_size"
    life.frame_start, life.frame_end = 1, 3
    life.cycles.use_denoising = False
    life.render.filepath = str(tmp_path / "f")
    bpy.ops.render.render(animation=True)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    for path in files:
        names = {name.split(".")[1] for name in read_channels(path)}
        assert names == {"Combined"}


@pytest.fixture
def unlike() -> Iterator[None]:
    """A Blender that keeps its lists otherwise."""
    usual = spare_passes._FIRST
    spare_passes._FIRST = spare_passes._MOST
    yield
    spare_passes._FIRST = usual


def test_they_stay_where_blender_is_not_as_expected(
    life: Any, multilayer: Any, network: Any, unlike: None
) -> None:
    names = {name.split(".")[1] for name in multilayer("XRDS", "x2")}
    assert {"Combined", "Denoising Albedo", "Denoising Normal"} <= names
