"""Try on This Frame: the button, its operator, and the image with a line."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

pytest.importorskip("mitsuba_oidn")

import xrds_blender
from xrds_blender.interface import split, try_frame
from xrds_blender.interface.properties import request_of
from xrds_blender.internals.lifetimes import FILE
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.rendering import history
from xrds_blender.rendering.try_frame import Way


@pytest.fixture
def scene(blend: Any) -> Any:
    found = bpy.context.scene
    found.frame_start, found.frame_end = 1, 5
    found.cycles.use_adaptive_sampling = False
    found.xrds.mode, found.xrds.temporal_radius = Mode.FULL_SIZE, 1
    found.frame_set(2)
    return found


def pixels_of(image: Any) -> np.ndarray:
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)


def test_the_operator_leaves_an_image_and_nothing_else(scene: Any) -> None:
    bpy.ops.render.render()
    (result,) = (x for x in bpy.data.images if x.type == "RENDER_RESULT")
    view = bpy.context.preferences.view
    before = scene.frame_current, scene.render.engine, view.render_display_type
    assert bpy.ops.xrds.try_frame() == {"FINISHED"}
    assert bpy.ops.xrds.try_frame() == {"FINISHED"}
    after = scene.frame_current, scene.render.engine, view.render_display_type
    assert after == before
    slots = result.render_slots
    assert slots.active_index == 0
    assert [slot.name for slot in slots].count("XRDS Try") == 1
    image = bpy.data.images[split.IMAGE]
    assert tuple(image.size) == (64, 48)
    assert image.is_float
    shown = FILE.of(split.Shown)
    assert shown.labels[0].startswith("Cycles, 1 sample, ")
    assert shown.labels[1].startswith("XRDS, ")
    split.move_to(image, 10)
    assert (pixels_of(image)[:, :10] == shown.left[:, :10]).all()
    assert (pixels_of(image)[:, 11:] == shown.right[:, 11:]).all()
    split.move_to(image, 999)
    assert shown.place == 63


def test_what_cannot_be_tried_is_reported(scene: Any) -> None:
    scene.frame_end = 1
    with pytest.raises(RuntimeError, match="is no animation"):
        bpy.ops.xrds.try_frame()


class Layout:
    def __init__(self) -> None:
        self.texts: list[str] = []

    def operator(self, name: str, *, text: str, **_: Any) -> None:
        assert name == "xrds.try_frame"
        self.texts.append(text)


def drawn(scene: Any) -> list[str]:
    layout = Layout()
    try_frame.draw_try(layout, scene, request_of(scene.xrds))
    return layout.texts


def test_the_button_tells_the_wait(scene: Any) -> None:
    assert drawn(scene) == ["Try on This Frame"]
    scene.cycles.samples = 8
    layer = history.Layer(
        scene.name, scene.view_layers[0].name, 64 * 48, history.scene_settings(scene)
    )
    settings = Settings(Mode.FULL_SIZE, 8, Denoising.XRDS_HIGH)
    history.remember(layer, settings, {"sync": 20.0, "beauty": 70.0, "denoise": 30.0})
    # three frames of XRDS and one of Cycles, of 90 s each without any denoiser
    assert drawn(scene) == ["Try on This Frame (about 6 min)"]
    scene.cycles.samples = 1  # in their seconds XRDS takes no two with neighbours
    assert drawn(scene) == ["Try on This Frame (about 4 min)"]


def test_a_label_tells_all() -> None:
    way = Way("Cycles", np.empty(0), 64, 41.0, at_most=True)
    assert try_frame.label(way) == "Cycles, ≤ 64 samples, 41 s"


def test_unregister_takes_the_labels_away(scene: Any) -> None:
    xrds_blender.unregister()
    try:
        assert not hasattr(bpy.types, "XRDS_OT_try_frame")
        assert not hasattr(bpy.types, "XRDS_OT_move_split")
    finally:
        xrds_blender.register()
