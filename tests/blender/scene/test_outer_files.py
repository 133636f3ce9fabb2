"""Files beside the .blend: each that a render reads counts for the samples."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender.planning.request import render_request
from xrds_blender.rendering.sample_cache import _key
from xrds_blender.scene.outer_files import outer_files


@pytest.fixture
def scene(empty_scene: Callable[..., Any], tmp_path: Path) -> Any:
    found = empty_scene(8, 8, 1)
    mesh = bpy.data.meshes.new("thing")
    found.collection.objects.link(bpy.data.objects.new("thing", mesh))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    return found


def image(path: Path, source: str) -> Any:
    found = bpy.data.images.load(str(path), check_existing=False)
    found.source = source
    return found


def tiled(folder: Path) -> None:
    found = image(folder / "t.1001.png", "TILED")
    found.filepath = "//t.<UDIM>.png"
    found.tiles.new(1002)


def modifier(kind: str, **values: Any) -> None:
    found = bpy.data.objects["thing"].modifiers.new("m", kind)
    for name, value in values.items():
        setattr(found, name, value)


def lamp(folder: Path) -> None:
    data = bpy.data.lights.new("lamp", "POINT")
    data.use_nodes = True
    node = data.node_tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", str(folder / "a.ies")


def geometry_nodes(_: Path) -> None:
    modifier("NODES")
    bpy.data.objects["thing"].modifiers["m"]["Socket_2"] = "//a.obj"


def library(folder: Path) -> None:
    world = bpy.data.worlds.new("w")
    bpy.data.libraries.write(str(folder / "lib.blend"), {world}, fake_user=True)
    with bpy.data.libraries.load(str(folder / "lib.blend"), link=True) as (_, to):
        to.worlds = ["w"]


FILES = {
    "image": ("a.png", lambda x: image(x / "a.png", "FILE")),
    "a sequence's later file": (
        "s0002.png",
        lambda x: image(x / "s0001.png", "SEQUENCE"),
    ),
    "a tile": ("t.1002.png", tiled),
    "mesh cache": ("a.mdd", lambda _: modifier("MESH_CACHE", filepath="//a.mdd")),
    "baked nodes": ("bake/x.bin", lambda _: modifier("NODES", bake_directory="//bake")),
    "an input of nodes": ("a.obj", geometry_nodes),
    "lamp's profile": ("a.ies", lamp),
    "volume": (
        "a.vdb",
        lambda _: setattr(bpy.data.volumes.new("v"), "filepath", "//a.vdb"),
    ),
    "library": ("lib.blend", library),
}


@pytest.mark.parametrize(("name", "use"), FILES.values(), ids=FILES.keys())
def test_a_file_that_changes_makes_other_samples(
    scene: Any, tmp_path: Path, name: str, use: Callable[[Path], object]
) -> None:
    for each in ("s0001.png", "t.1001.png", name):
        path = tmp_path / each
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"one")
    use(tmp_path)
    path = tmp_path / name
    before, time = _key(render_request(1), None), path.stat().st_mtime
    assert _key(render_request(1), None) == before
    path.write_bytes(path.read_bytes()[:-1] + b"!")  # of the same size
    os.utime(path, (time, time))  # and time
    assert _key(render_request(1), None) != before
    path.unlink()
    assert _key(render_request(1), None) != before


def test_what_lies_in_the_file_is_none(scene: Any, tmp_path: Path) -> None:
    """Nor a folder with the file itself, where frames may be written."""
    bpy.data.images.new("generated", 4, 4).filepath = "//nowhere.png"
    (tmp_path / "p.png").write_bytes(b"one")
    image(tmp_path / "p.png", "FILE").pack()
    modifier("NODES", bake_directory="//")
    assert outer_files() == []
