"""The live picture: what changes in a window changes no pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")

from xrds_blender.cycles import session


@pytest.mark.parametrize("way", ["full_size", "x2"])
def test_a_watched_render_is_the_same(
    life: Any, network: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    """With a noisy picture asked for, which Cycles would show as black."""
    settings = life.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    life.cycles.use_denoising = True
    life.view_layers[0].cycles.use_denoising = True
    life.render.engine, life.xrds.mode = "XRDS", way

    def render(name: str, watched: bool) -> dict[str, np.ndarray]:
        monkeypatch.setattr(session, "_is_watched", lambda: watched)
        life.render.filepath = str(tmp_path / f"{name}.exr")
        bpy.ops.render.render(write_still=True)
        return read_channels(life.render.filepath)

    alone, watched = render("alone", False), render("watched", True)
    assert any(name.endswith("Noisy Image.R") for name in alone)
    assert set(watched) == set(alone)
    for name, pixels in alone.items():
        np.testing.assert_array_equal(watched[name], pixels, err_msg=name)
