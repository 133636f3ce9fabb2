"""The standard measure on a scene of a few pixels, rendered once."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from xrds_core import exr
from xrds_core.superres.network import XRDS, preset_config
from xrds_lab import metrics
from xrds_lab.bench.evaluate import evaluate
from xrds_lab.bench.inputs import Folder, Request
from xrds_lab.bench.journal import Strict
from xrds_lab.bench.pictures import Networks, Pictures
from xrds_lab.bench.rivals import ENLARGEMENTS
from xrds_lab.bench.windows import find_shots
from xrds_lab.weights import save_network

pytestmark = pytest.mark.nightly  # it takes minutes

FRAME, WINDOW = [128, 96], [32, 16, 64, 48]


def save_scene(path: Path) -> None:
    """A textured floor under a sky and a lamp: structure in x and in y."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=6)
    material = bpy.data.materials.new("checks")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    checker = nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 17
    shader = nodes["Principled BSDF"]
    links.new(checker.outputs["Color"], shader.inputs["Base Color"])
    bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0.3, 0))
    bpy.context.object.data.energy = 3
    bpy.ops.object.camera_add(location=(0.3, -4, 4), rotation=(0.75, 0, 0.1))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.render.engine = "CYCLES"
    scene.view_settings.exposure = 0.5
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


class World:
    """Files of a measurement, and how to run it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scene = folder / "floor.blend"
        self.windows = folder / "windows.json"
        self.cache = folder / "cache"
        self.reference = folder / "floor.exr"

    def prepare(self) -> None:
        save_scene(self.scene)
        entry = {"resolution": FRAME, "window": WINDOW, "floor_psnr": 42.0}
        self.windows.write_text(json.dumps({"floor": entry}), "utf-8")
        self.reference.touch()
        (shot,) = find_shots([self.scene], self.windows, self.folder)
        request, folder = Request("plain", 32), Folder(self.cache)
        pictures = Pictures(shot, folder, Networks(None, "cpu"))
        pictures.render([request], Strict(), print)
        arrays = folder.read(request.file_name(shot))
        assert arrays is not None
        self.truth = arrays["radiance"]
        planes = {letter: self.truth[..., i] for i, letter in enumerate("RGB")}
        exr.write_picture(self.reference, planes)

    def run(self, **options: Any) -> dict[str, Any]:
        settings = {"scales": [2], "samples": 4, "guide_samples": 2} | options
        return evaluate(
            [self.scene],
            windows=self.windows,
            references=self.folder,
            cache=self.cache,
            **settings,
        )


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    made = World(tmp_path_factory.mktemp("measure"))
    made.prepare()
    return made


@pytest.fixture(scope="module")
def report(world: World) -> dict[str, Any]:
    return world.run(scales=[2, 4])


def test_every_rival_is_measured(report: dict[str, Any]) -> None:
    keys = [(r["scene"], r["scale"], r["preset"]) for r in report["scenes"]]
    assert keys == [("floor", scale, "fast") for scale in (2, 4)]
    for record in report["scenes"]:
        rivals = set(ENLARGEMENTS) | {"oidn_equal_spp"}
        assert rivals <= set(record["methods"])
        for row in record["methods"].values():
            assert 10 < row["psnr"] < 60
            assert 0 < row["relmse_trimmed"] <= row["relmse"] < 1
            assert 0 < row["flip"] < 1
        assert record["reference_psnr_floor"] == 42.0


def test_checks_in_the_albedo_are_won_by_demodulation(report: dict[str, Any]) -> None:
    for record in report["scenes"]:
        methods = record["methods"]
        better = methods["demodulated_bilinear"]["psnr"] - methods["bicubic"]["psnr"]
        assert better > 1


def test_low_resolution_and_guides_lie_on_the_reference(
    world: World, report: dict[str, Any]
) -> None:
    (shot,) = find_shots([world.scene], world.windows, world.folder)
    low = Folder(world.cache).read(Request("low", 4, 4).file_name(shot))
    assert low is not None
    assert low["view_exposure"] == 0.5
    errors = {}
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            moved = np.roll(world.truth, (dy, dx), axis=(0, 1))
            means = moved.reshape(12, 4, 16, 4, 3).mean(axis=(1, 3))
            inner = slice(1, -1)
            errors[dy, dx] = metrics.psnr(
                low["radiance"][inner, inner], means[inner, inner]
            )
    assert max(errors, key=errors.__getitem__) == (0, 0), errors


def test_a_second_run_renders_nothing(
    world: World, report: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    # the package's attribute of this name is the public function
    module = importlib.import_module("xrds_blender.rendering.blender_job")
    monkeypatch.setattr(module, "run_job", lambda *a, **k: pytest.fail("rendered"))
    again = world.run(scales=[2, 4], out=world.folder)
    assert again == report
    assert json.loads((world.folder / "results.json").read_text()) == again


def test_a_spoilt_file_is_rendered_again(world: World, report: dict[str, Any]) -> None:
    (file,) = world.cache.glob("*low4*")
    file.write_bytes(file.read_bytes()[:5000])
    again = world.run(scales=[4])
    assert len(again["scenes"]) == 1
    assert file.stat().st_size > 5000


def test_the_product_comes_first(world: World) -> None:
    network = XRDS(preset_config("fast", 2))
    save_network(network, world.folder / "fast_x2.safetensors", {})
    report = world.run(weights=world.folder)
    (record,) = report["scenes"]
    assert next(iter(record["methods"])) == "xrds"
    assert record["gain"] == report["worst"]["2"]["fast"]["gain"]


def test_rivals_are_measured_without_weights(world: World) -> None:
    folder = world.folder / "empty"
    folder.mkdir()
    (record,) = world.run(weights=folder)["scenes"]
    assert set(record["methods"]) == set(ENLARGEMENTS) | {"oidn_equal_spp"}
