"""The held-out scenes: what the list names is built, and moves."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy")

from xrds_core.errors import UsageError
from xrds_lab.held_out import scenes
from xrds_lab.held_out.stage import JUDGED

NAMES = [scene.name for scene in scenes.listed()]


@pytest.fixture(scope="session")
def stand_ins(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A cube, a grey sky and a grey texture, for any asset."""
    folder = tmp_path_factory.mktemp("stand-ins")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    model, sky, albedo = (folder / x for x in ("a.glb", "a.exr", "albedo.png"))
    bpy.ops.export_scene.gltf(filepath=str(model))
    image = bpy.data.images.new("sky", 8, 4, float_buffer=True)
    image.filepath_raw, image.file_format = str(sky), "OPEN_EXR"
    image.save()
    Image.fromarray(np.full((4, 4, 3), 128, np.uint8)).save(albedo)
    return {"models": model, "skies": sky, "textures": albedo}


def assets(scene: scenes.Listed, stand_ins: dict[str, Path], folder: Path) -> Path:
    """A folder that has what the list says that the scene takes, and nothing else."""
    for path in scene.files(folder):
        kind = {".glb": "models", ".exr": "skies"}.get(path.suffix, "textures")
        target = path / "albedo.png" if kind == "textures" else path
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(stand_ins[kind], target)
    return folder


def test_the_list_and_the_script_have_the_same_scenes() -> None:
    assert list(scenes.builders()) == NAMES
    assert len(NAMES) >= 8
    for scene in scenes.listed():
        assert scene.shows.endswith(".")
        assert scene.moves.endswith(".")
    assert len({scene.moves for scene in scenes.listed()}) == len(NAMES)


@pytest.mark.parametrize("scene", scenes.listed(), ids=NAMES)
def test_a_file_opens_with_a_camera_and_a_shot(
    scene: scenes.Listed, stand_ins: dict[str, Path], tmp_path: Path
) -> None:
    folder = assets(scene, stand_ins, tmp_path / "assets")
    (path,) = scenes.build(folder, tmp_path / "out", [scene.name])
    shutil.rmtree(folder)  # the file holds all that it needs
    bpy.ops.wm.open_mainfile(filepath=str(path))
    opened = bpy.context.scene
    assert path.name == f"{scene.name}.blend"
    assert opened.camera is not None
    assert opened.frame_current == JUDGED
    assert not missing_files()
    assert shown(opened, JUDGED - 4) != shown(opened, JUDGED + 4)


def missing_files() -> list[str]:
    return [x.name for x in bpy.data.images if x.source == "FILE" and not x.packed_file]


def shown(scene: object, frame: int) -> list[object]:
    """Where everything is and what the camera sees of it."""
    scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    places = [x for thing in graph.objects for row in thing.matrix_world for x in row]
    return [*places, graph.objects[scene.camera.name].data.lens]


def test_what_is_missing_is_said_before_anything_is_built(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"st_fagans_interior_1k\.exr"):
        next(scenes.build(tmp_path, tmp_path / "out", ["tea-table"]))
    with pytest.raises(UsageError, match="no scenes lawn"):
        next(scenes.build(tmp_path, tmp_path / "out", ["lawn"]))
    assert not (tmp_path / "out").exists()


def test_the_command_says_what_is_missing(tmp_path: Path) -> None:
    words = ["-m", "xrds_lab.held_out", str(tmp_path), str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, *words], check=False, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "assets are missing" in done.stderr
