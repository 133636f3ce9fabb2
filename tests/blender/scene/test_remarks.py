"""What the command says of a file that asks for more than it renders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from compositing import empty_compositor

bpy = pytest.importorskip("bpy")

from xrds_blender.command import main
from xrds_blender.planning.request import render_request
from xrds_blender.scene.remarks import remarks


@pytest.fixture
def scene(empty_scene: Callable[..., Any], tmp_path: Path) -> Any:
    found = empty_scene(8, 8, 1)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    return found


def composite(scene: Any, kind: str) -> None:
    empty_compositor(scene).nodes.new(kind)


def strip(scene: Any) -> None:
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_effect(name="s", type="COLOR", channel=1, **_length())


def _length() -> dict[str, int]:
    last = "length" if bpy.app.version >= (5,) else "frame_end"
    return {"frame_start": 1, last: 9}


def multilayer(scene: Any) -> None:
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"


def texture(scene: Any) -> None:
    image = bpy.data.images.new("t", 4, 4)
    image.source, image.filepath = "FILE", "//gone.png"


def tile(scene: Any) -> None:
    image = bpy.data.images.new("t", 4, 4, tiled=True)
    image.filepath = "//t.<UDIM>.png"


def cache(scene: Any) -> None:
    mesh = bpy.data.meshes.new("m")
    item = bpy.data.objects.new("m", mesh)
    scene.collection.objects.link(item)
    item.modifiers.new("m", "MESH_CACHE").filepath = "//gone.mdd"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: composite(s, "CompositorNodeBlur"), "the compositor is not run"),
        (strip, "not the video sequence"),
        (lambda s: setattr(s.render, "use_freestyle", True), "Freestyle's lines"),
        (lambda s: setattr(s.render, "use_stamp", True), "not burnt into"),
        (lambda s: s.view_layers.new("Back"), "not Back; --view-layer"),
        (multilayer, "without the file's other passes"),
        (texture, "missing textures, which render pink: "),
        (tile, "t.1001.png"),
        (cache, "gone.mdd (object 'm')"),
    ],
)
def test_each_is_one_line(scene: Any, change: Callable[[Any], Any], told: str) -> None:
    assert remarks(scene, render_request(1)) == []
    change(scene)
    (line,) = remarks(scene, render_request(1))
    assert told in line


def test_passes_that_a_layer_has_not_switched_on(scene: Any) -> None:
    request = render_request(1, passes=("all",))
    (line,) = remarks(scene, request)
    assert "has no passes of light" in line
    scene.view_layers[0].use_pass_emit = True
    assert remarks(scene, request) == []


def test_a_compositor_that_changes_nothing_is_not_told(scene: Any) -> None:
    composite(scene, "NodeFrame")
    assert remarks(scene, render_request(1)) == []


def test_render_and_plan_say_it(
    scene: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    texture(scene)
    bpy.data.images["t"].use_fake_user = True
    path = tmp_path / "a.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert main.main(["plan", str(path)]) == 0
    assert "note: missing textures" in capfd.readouterr().out
    words = ["render", str(path), "--plain", "-o", str(tmp_path / "a.exr")]
    assert main.main(words) == 0
    assert "xrds: missing textures" in capfd.readouterr().err
