"""The demo's scene and its comparison picture."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from xrds_lab.demo import comparison
from xrds_lab.demo.scene import build


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """A quick Cycles render of the scene, sRGB in 0..255."""
    scene = build(192, 108)
    scene.cycles.samples = 8
    scene.cycles.use_denoising = True
    path = tmp_path_factory.mktemp("demo") / "scene.png"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return np.asarray(Image.open(path).convert("RGB"), np.float32)


def principled(name: str) -> list[object]:
    """The value of one Principled BSDF input in every material."""
    return [
        node.inputs[name].default_value
        for material in bpy.data.materials
        for node in material.node_tree.nodes
        if node.type == "BSDF_PRINCIPLED"
    ]


def test_scene_has_what_is_hard() -> None:
    build(64, 36)
    kinds = {n.type for m in bpy.data.materials for n in m.node_tree.nodes}
    assert {"BUMP", "TEX_NOISE", "TEX_BRICK", "TEX_CHECKER", "TEX_WAVE"} <= kinds
    assert 1.0 in principled("Transmission Weight")
    assert 1.0 in principled("Metallic")
    assert [thing for thing in bpy.data.objects if thing.type == "FONT"]
    assert not [image for image in bpy.data.images if image.source == "FILE"]


def test_picture_is_well_lit(picture: np.ndarray) -> None:
    light = picture.mean(axis=2)
    assert 70 < light.mean() < 170
    assert (light > 250).mean() < 0.02
    assert (light < 5).mean() < 0.05


def test_picture_is_full_of_detail(picture: np.ndarray) -> None:
    # A picture that an enlargement by four loses nothing of would show nothing.
    blocks = picture.reshape(27, 4, 48, 4, 3)
    inside = (blocks - blocks.mean(axis=(1, 3), keepdims=True)).std()
    assert inside > 12


def test_building_twice_gives_one_scene() -> None:
    build(64, 36)
    names = sorted(thing.name for thing in bpy.data.objects)
    build(64, 36)
    assert sorted(thing.name for thing in bpy.data.objects) == names


def test_comparison_shows_every_column(tmp_path: Path) -> None:
    bright = np.full((540, 960, 3), 0.9, np.float32)
    dark = np.zeros((540, 960, 3), np.float32)
    path = tmp_path / "comparison.png"
    comparison.compare([("bright", bright), ("dark", dark)], path)
    sheet = np.asarray(Image.open(path), np.float32)
    rows, columns = sheet[comparison.LABEL + 10 :, :, 0].shape
    left = sheet[comparison.LABEL + 10, comparison.GAP + 10, 0]
    right = sheet[comparison.LABEL + 10, columns - comparison.GAP - 10, 0]
    assert left > 240
    assert right == 0
    assert rows > 4 * comparison.CROP[1] * comparison.ZOOM


def test_crops_lie_inside_small_pictures(tmp_path: Path) -> None:
    small = np.full((80, 110, 3), 0.5, np.float32)
    comparison.compare([("small", small)], tmp_path / "small.png")
    sheet = np.asarray(Image.open(tmp_path / "small.png"))
    crops = sheet[comparison.LABEL :: 210, comparison.GAP + 5, 0]
    assert (crops > 100).all()


def test_low_pixels_are_repeated() -> None:
    low = np.arange(6, dtype=np.float32).reshape(2, 3, 1)
    grown = comparison.enlarged(low, 3, 5)
    assert grown.shape == (3, 5, 1)
    assert grown[0, :, 0].tolist() == [0, 0, 1, 1, 2]
    assert grown[2, 0, 0] == 3
