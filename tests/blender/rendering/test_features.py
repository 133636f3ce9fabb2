"""What artists use of F12, under XRDS; the network is a stand-in.

docs/compatibility.md names the test of each feature.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")

from compositing import compositor

from xrds_blender import render, run_job
from xrds_blender.cycles import session
from xrds_blender.planning.request import Machine
from xrds_blender.planning.settings import Denoising
from xrds_blender.rendering.loading import in_process

BLENDER_5 = bpy.app.version >= (5, 0)


@pytest.fixture
def channels(tmp_path: Path) -> Callable[..., dict[str, np.ndarray]]:
    """Render to a multilayer EXR by Blender's own output settings and read it."""

    def read(scene: Any, engine: str) -> dict[str, np.ndarray]:
        settings = scene.render.image_settings
        if BLENDER_5:
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
        path = tmp_path / f"{engine}.exr"
        scene.render.filepath, scene.render.engine = str(path), engine
        bpy.ops.render.render(write_still=True)
        return read_channels(path)

    return read


@pytest.fixture
def settings_of_passes(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Cycles' settings at each of its renders."""
    seen: list[dict[str, Any]] = []
    names = ("samples", "use_adaptive_sampling", "adaptive_threshold", "time_limit")
    run = session.run

    def watched(engine: Any, depsgraph: Any, **more: Any) -> Any:
        cycles = depsgraph.scene_eval.cycles
        seen.append({name: getattr(cycles, name) for name in names})
        return run(engine, depsgraph, **more)

    monkeypatch.setattr(session, "run", watched)
    return seen


def enlarged(scene: Any, scale: int = 2) -> np.ndarray:
    """What the stand-in makes of the scene's small render."""
    ours = in_process(Denoising.XRDS_HIGH, Machine())
    low = run_job(scene, lambda p: p.beauty(scale, in_process=ours)).radiance
    large = low.repeat(scale, 0).repeat(scale, 1)
    return large[: scene.render.resolution_y, : scene.render.resolution_x]


@pytest.mark.parametrize("percentage", [50, 77, 150])
def test_resolution_percentage(
    life: Any, network: Any, written: Any, percentage: int
) -> None:
    life.render.resolution_percentage = percentage
    picture = written(life)
    height, width = 33 * percentage // 100, 45 * percentage // 100
    assert picture.shape[:2] == (height, width)
    assert picture[..., :3].min(axis=2).any()


def test_depth_of_field(life: Any, network: Any, written: Any) -> None:
    life.cycles.samples = 256  # less noise than blur, without a denoiser too
    sharp = written(life)
    dof = life.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 1.0, 0.05
    blurred = written(life)
    np.testing.assert_array_equal(blurred[..., :3], enlarged(life))
    assert (
        np.abs(np.diff(blurred, axis=1)).mean() < np.abs(np.diff(sharp, axis=1)).mean()
    )


def test_noise_threshold_and_time_limit_hold_for_the_small_render(
    life: Any, network: Any, settings_of_passes: list[dict[str, Any]], written: Any
) -> None:
    cycles = life.cycles
    cycles.samples, cycles.time_limit = 8, 60.0
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, 0.25
    written(life)
    low, *_, guides = settings_of_passes  # between them a probe for kept guides
    assert low == {
        "samples": 8,
        "use_adaptive_sampling": True,
        "adaptive_threshold": 0.25,
        "time_limit": 60.0,
    }
    assert (guides["samples"], guides["use_adaptive_sampling"]) == (4, False)
    assert guides["time_limit"] == 0.0


def data_names(channels: dict[str, np.ndarray]) -> list[str]:
    words = ("Depth", "Position", "Vector", "Index", "IndexOB", "IndexMA", "Normal")
    return [
        name
        for name in channels
        if name.split(".")[1] in words
        or name.split(".")[1] in ("Object Index", "Material Index")
    ]


def test_data_passes_are_those_of_a_full_size_render(
    life: Any, network: Any, channels: Any
) -> None:
    """Bit for bit what Cycles alone writes with the guides' samples."""
    layer = life.view_layers[0]
    layer.use_pass_z = layer.use_pass_position = layer.use_pass_vector = True
    layer.use_pass_object_index = layer.use_pass_material_index = True
    layer.use_pass_normal = True
    bpy.data.objects["Red"].pass_index = 7
    bpy.data.materials["mirror"].pass_index = 3
    passes = channels(life, "XRDS")
    life.cycles.samples = life.xrds.guide_samples
    expected = channels(life, "CYCLES")
    names = data_names(expected)
    assert len(names) >= 13  # 1 depth, 3 position, 4 vector, 2 indices, 3 normal
    for name in names:
        np.testing.assert_array_equal(passes[name], expected[name], err_msg=name)
    indices = [passes[n] for n in names if "IndexOB" in n or "Object Index" in n]
    assert set(np.unique(indices)) == {0.0, 7.0}


def test_cryptomatte_is_full_size_and_takes_sixteen_samples(
    life: Any, network: Any, channels: Any, settings_of_passes: list[dict[str, Any]]
) -> None:
    life.view_layers[0].use_pass_cryptomatte_object = True
    passes = channels(life, "XRDS")
    assert settings_of_passes[-1]["samples"] == 16
    life.cycles.samples = 16
    expected = channels(life, "CYCLES")
    names = [name for name in expected if "Crypto" in name]
    assert len(names) >= 12
    for name in names:
        np.testing.assert_array_equal(passes[name], expected[name], err_msg=name)


def test_the_plan_says_why_cryptomatte_costs_samples(life: Any, network: Any) -> None:
    plan = {d.decision: d for d in render(life, 2).plan}
    assert int(plan["guide samples"].value) < 16
    life.view_layers[0].use_pass_cryptomatte_material = True
    plan = {d.decision: d for d in render(life, 2).plan}
    assert plan["guide samples"].value == "16"
    assert "Cryptomatte" in plan["guide samples"].reason


def test_an_aov_is_that_of_the_full_size_render(
    life: Any, network: Any, channels: Any
) -> None:
    life.view_layers[0].aovs.add().name = "mask"
    tree = bpy.data.materials["red"].node_tree
    output = tree.nodes.new("ShaderNodeOutputAOV")
    if BLENDER_5 or hasattr(output, "aov_name"):
        output.aov_name = "mask"
    output.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    passes = channels(life, "XRDS")
    life.cycles.samples = life.xrds.guide_samples
    expected = channels(life, "CYCLES")
    names = [name for name in expected if ".mask." in name]
    assert len(names) == 4
    for name in names:
        np.testing.assert_allclose(passes[name], expected[name], atol=1e-6)
    assert max(passes[name].max() for name in names) > 0.9


def test_light_passes_add_up_to_the_small_picture(
    life: Any, network: Any, channels: Any
) -> None:
    """They are the small render's, enlarged: no bounce is missing from them."""
    layer = life.view_layers[0]
    layer.use_pass_diffuse_direct = layer.use_pass_diffuse_indirect = True
    life.cycles.samples = 16
    passes = channels(life, "XRDS")
    expected = channels(life, "CYCLES")
    names = [n for n in expected if "Diff" in n and ("Ind" in n)]
    assert len(names) == 3
    for name in names:
        assert passes[name].shape == (33, 45)
        assert passes[name].mean() == pytest.approx(expected[name].mean(), rel=0.25)


def test_stereo_enlarges_both_views(life: Any, network: Any, tmp_path: Path) -> None:
    life.render.engine, life.render.use_multiview = "XRDS", True
    life.camera.data.stereo.interocular_distance = 0.8
    settings = life.render.image_settings
    settings.file_format, settings.views_format = "PNG", "INDIVIDUAL"
    life.render.filepath = str(tmp_path / "eye.png")
    bpy.ops.render.render(write_still=True)
    left, right = sorted(path.name for path in tmp_path.iterdir())
    assert (left, right) == ("eye_L.png", "eye_R.png")
    assert (tmp_path / left).read_bytes() != (tmp_path / right).read_bytes()
    assert len(network[0].calls) == 2


def test_cameras_bound_to_markers(life: Any, network: Any, tmp_path: Path) -> None:
    other = life.camera.copy()
    life.collection.objects.link(other)
    other.location.x = 3.0
    for frame, camera in ((1, life.camera), (2, other)):
        life.timeline_markers.new(f"cut {frame}", frame=frame).camera = camera
    life.frame_start, life.frame_end = 1, 2
    life.render.engine = "XRDS"
    life.render.filepath = str(tmp_path / "cut_")
    bpy.ops.render.render(animation=True)
    one, two = [path.read_bytes() for path in sorted(tmp_path.iterdir())]
    assert one != two


def test_simplify_holds_for_both_renders(life: Any, network: Any, written: Any) -> None:
    """Subdivision that simplify takes away is missing in picture and guides alike."""
    cube = bpy.data.objects["Red"]
    cube.modifiers.new("round", "SUBSURF").render_levels = 3
    written(life)
    life.render.use_simplify, life.render.simplify_subdivision_render = True, 0
    picture = written(life)
    np.testing.assert_array_equal(picture[..., :3], enlarged(life))
    round_albedo, cube_albedo = (n.calls[0]["albedo"] for n in network)
    assert np.abs(round_albedo - cube_albedo).mean() > 0.01


def test_two_scenes_in_one_compositor(life: Any, network: Any, written: Any) -> None:
    """The other scene of a Render Layers node is rendered with its own engine."""
    other = bpy.data.scenes.new("Other")
    other.camera = life.camera
    other.world = life.world
    other.render.resolution_x, other.render.resolution_y = 45, 33
    other.render.resolution_percentage = 100
    other.render.engine, other.xrds.mode = "XRDS", "x2"
    other.cycles.samples, other.cycles.use_denoising = 2, False
    tree, end = compositor(life)
    layers = tree.nodes.new("CompositorNodeRLayers")
    layers.scene = other
    tree.links.new(layers.outputs["Image"], end)
    picture = written(life)
    assert len(network) == 1  # the first scene's own layers are not asked for
    sky = np.broadcast_to((0.25, 0.35, 0.5), (33, 45, 3))
    np.testing.assert_allclose(picture[..., :3], sky, atol=0.05)


def file_output(tree: Any, folder: Path) -> Any:
    """A File Output node for one EXR; its socket."""
    node = tree.nodes.new("CompositorNodeOutputFile")
    if BLENDER_5:
        node.directory, node.file_name = str(folder), "node"
        node.format.media_type = "IMAGE"
        node.file_output_items.new("RGBA", "node")
    else:
        node.base_path = str(folder)
        node.file_slots[0].path = "node"
    node.format.file_format, node.format.color_depth = "OPEN_EXR", "32"
    return node.inputs[0]


def test_a_graph_with_a_file_output_gives_what_it_gives_under_cycles(
    life: Any, network: Any, written: Any, load: Any, tmp_path: Path
) -> None:
    """Blur of the picture times its depth: the graph is the same under both."""
    life.xrds.mode = "cycles_only"
    life.view_layers[0].use_pass_z = True
    tree, end = compositor(life)
    layers = tree.nodes.new("CompositorNodeRLayers")
    invert = tree.nodes.new("CompositorNodeInvert")
    tree.links.new(layers.outputs["Image"], invert.inputs["Color"])
    tree.links.new(invert.outputs[0], end)
    results = {}
    for engine in ("CYCLES", "XRDS"):
        folder = tmp_path / engine
        folder.mkdir()
        tree.links.new(invert.outputs[0], file_output(tree, folder))
        composite = written(life, engine)
        (path,) = folder.iterdir()
        results[engine] = composite, load(path)
        tree.nodes.remove(next(n for n in tree.nodes if n.type == "OUTPUT_FILE"))
    for cycles, ours in zip(*results.values(), strict=True):
        np.testing.assert_array_equal(ours, cycles)
    life.xrds.mode = "x2"
    tree.links.new(invert.outputs[0], file_output(tree, tmp_path / "enlarged"))
    composite = written(life)
    (path,) = (tmp_path / "enlarged").iterdir()
    np.testing.assert_array_equal(load(path)[..., :3], composite[..., :3])
    np.testing.assert_allclose(composite[..., :3], 1 - enlarged(life), atol=1e-5)


def test_baking_is_cycles_own(life: Any, network: Any) -> None:
    cube = bpy.data.objects["Red"]
    cube.data.uv_layers.new(name="map")
    image = bpy.data.images.new("baked", 8, 8, float_buffer=True)
    tree = bpy.data.materials["red"].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.nodes.active = node
    bpy.context.view_layer.objects.active = cube
    cube.select_set(True)

    def baked(engine: str) -> np.ndarray:
        life.render.engine = engine
        done = bpy.ops.object.bake(type="DIFFUSE", pass_filter={"COLOR"})
        assert done == {"FINISHED"}
        return np.array(image.pixels)

    ours = baked("XRDS")
    np.testing.assert_array_equal(ours, baked("CYCLES"))
    assert ours[0::4].max() > 0.7  # the cube's red
    assert not network


def test_tiles_of_a_frame_merge_nearly_to_the_whole(life: Any, written: Any) -> None:
    """Crops of one frame with the shipped network, as Flamenco renders stills.

    Position and exposure are the whole frame's. A tile's denoiser and network see
    nothing beyond its border, so pixels at a seam differ; docs/farms.md says so.
    """
    pytest.importorskip("torch")
    edges = life.render
    edges.resolution_x, edges.resolution_y = 96, 64
    life.cycles.samples, life.xrds.guide_samples = 64, 16
    whole = written(life)[..., :3]
    edges.use_border = edges.use_crop_to_border = True
    merged = np.zeros_like(whole)
    for column, row in ((0, 0), (48, 0), (0, 32), (48, 32)):
        edges.border_min_x, edges.border_max_x = column / 96, (column + 48) / 96
        edges.border_min_y, edges.border_max_y = 1 - (row + 32) / 64, 1 - row / 64
        merged[row : row + 32, column : column + 48] = written(life)[..., :3]
    assert np.abs(merged - whole).mean() < 0.015 * whole.mean()  # measured: 0.010
    step = np.abs(np.diff(merged, axis=1) - np.diff(whole, axis=1))[:, 47].mean()
    assert step < 0.03  # measured: 0.017, beside 0.002 inside the tiles
