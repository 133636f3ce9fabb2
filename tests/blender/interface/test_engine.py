"""F12, animations and the compositor under XRDS; the network is a stand-in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

from xrds_lab.weights import save_network

bpy = pytest.importorskip("bpy")

from compositing import compositor

from xrds_blender import render, run_job
from xrds_blender.planning.request import Machine
from xrds_blender.planning.settings import Denoising
from xrds_blender.rendering.loading import in_process
from xrds_core.errors import UsageError, WeightsError

BLENDER_5 = bpy.app.version >= (5, 0)


def low_picture(scene: Any, scale: int = 2) -> np.ndarray:
    """What the stand-in makes of the scene's low-resolution render."""
    ours = in_process(Denoising.XRDS_HIGH, Machine())
    beauty = run_job(scene, lambda passes: passes.beauty(scale, in_process=ours))
    large = beauty.radiance.repeat(scale, 0).repeat(scale, 1)
    return large[: scene.render.resolution_y, : scene.render.resolution_x]


@pytest.mark.parametrize("scale", ["2", "4", "8"])
def test_a_still_is_the_enlarged_picture(
    life: Any, network: Any, written: Any, scale: str
) -> None:
    life.xrds.mode = f"x{scale}"
    picture = written(life)
    np.testing.assert_array_equal(picture[..., :3], low_picture(life, int(scale)))
    np.testing.assert_array_equal(picture[..., 3], 1.0)
    assert network[0].scale == int(scale)


def test_plain_is_cycles_bit_for_bit(life: Any, written: Any) -> None:
    expected = written(life, "CYCLES")
    picture = render(life, 2, plain=True)
    np.testing.assert_array_equal(picture.radiance, expected[..., :3])
    np.testing.assert_array_equal(picture.alpha, expected[..., 3])
    life.xrds.mode = "cycles_only"
    np.testing.assert_array_equal(written(life), expected)


@pytest.mark.parametrize("crop", [False, True])
def test_a_border_agrees_with_the_whole(
    life: Any, network: Any, written: Any, crop: bool
) -> None:
    life.cycles.samples = 64
    whole = written(life)
    edges = life.render
    edges.use_border, edges.use_crop_to_border = True, crop
    edges.border_min_x, edges.border_max_x = 0.31, 0.8
    edges.border_min_y, edges.border_max_y = 0.2, 0.93
    part = written(life)
    rows, columns = slice(3, 27), slice(13, 36)
    assert part.shape[:2] == ((24, 23) if crop else (33, 45))
    if not crop:
        outside = part.copy()
        outside[rows, columns] = 0.0
        assert not outside.any()
        part = part[rows, columns]
    assert np.abs(part - whole[rows, columns]).mean() < 0.05
    exposures = [call["exposure"] for call in (network[0].calls + network[1].calls)]
    assert exposures[0] is None  # the whole picture tells its own
    assert exposures[1] == pytest.approx(auto_exposure(life, whole), rel=0.2)


def auto_exposure(scene: Any, picture: np.ndarray) -> float:
    from xrds_core.superres import front_end

    return front_end.auto_exposure(np.ascontiguousarray(picture[..., :3]))


def test_a_transparent_film_leaves_alpha_to_network(
    life: Any, network: Any, written: Any
) -> None:
    life.render.film_transparent = True
    bpy.data.objects["Floor"].hide_render = True
    picture = written(life)
    assert picture[0, 0, 3] == 0.0
    assert picture[20, 12, 3] == 1.0
    call = network[0].calls[0]
    assert call["radiance"].shape == (17, 23, 4)
    assert call["guide_alpha"].shape == (33, 45)
    assert call["guide_alpha"].min() == 0.0


def test_an_animation_with_motion_blur(
    life: Any, network: Any, tmp_path: Path, written: Any, load: Any
) -> None:
    cube = bpy.data.objects["Red"]
    for frame, height in ((1, 1.0), (3, 3.0)):
        cube.location.z = height
        cube.keyframe_insert("location", frame=frame)
    life.render.use_motion_blur = True
    life.xrds.temporal_radius = 0  # else the frames lend each other samples
    life.frame_start, life.frame_end = 1, 3
    life.frame_set(2)
    alone = written(life)
    life.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    assert life.frame_current == 2
    frames = [load(path) for path in sorted(tmp_path.glob("frame_*.exr"))]
    assert len(frames) == 3
    np.testing.assert_array_equal(frames[1], alone)
    assert np.abs(frames[0] - frames[2]).mean() > 0.01


def test_persistent_data_changes_no_pixel(
    life: Any, network: Any, written: Any
) -> None:
    """Renders that share a session, with changes between them, agree with new ones."""
    cube = bpy.data.objects["Red"]

    def renders(persistent: bool) -> list[np.ndarray]:
        life.render.use_persistent_data = persistent
        pictures = []
        for height, samples in ((1.0, 2), (1.0, 2), (2.0, 4), (2.0, 1)):
            cube.location.z, life.cycles.samples = height, samples
            pictures.append(written(life))
        life.render.use_persistent_data = False
        return pictures

    for kept, fresh in zip(renders(True), renders(False), strict=True):
        np.testing.assert_array_equal(kept, fresh)


def test_the_network_sees_the_picture_before_denoising(life: Any, network: Any) -> None:
    render(life, 2, samples=2, seed=1)
    ours = in_process(Denoising.XRDS_HIGH, Machine())
    rough, smooth = run_job(
        life,
        lambda passes: [
            passes.beauty(2, 2, denoise=d, seed=1, in_process=ours)
            for d in (False, True)
        ],
    )
    (call,) = network[0].calls
    np.testing.assert_array_equal(call["noisy"], rough.radiance)
    np.testing.assert_array_equal(call["radiance"][..., :3], smooth.radiance)
    assert np.abs(rough.radiance - smooth.radiance).max() > 0.01


def multilayer(scene: Any, path: Path) -> dict[str, np.ndarray]:
    """Every channel of a multilayer EXR, over all its parts."""
    settings = scene.render.image_settings
    if BLENDER_5:
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath, scene.render.engine = str(path), "XRDS"
    bpy.ops.render.render(write_still=True)
    return read_channels(path)


def test_two_view_layers_with_their_passes(
    life: Any, network: Any, tmp_path: Path
) -> None:
    """Each layer has its own picture, guides at full size and light passes."""
    life.view_layers[0].name = "A"
    other = life.view_layers.new("B")
    hidden = bpy.data.collections.new("hidden")
    life.collection.children.link(hidden)
    cube = bpy.data.objects["Red"]
    life.collection.objects.unlink(cube)
    hidden.objects.link(cube)
    other.layer_collection.children["hidden"].exclude = True
    for layer in life.view_layers:
        layer.use_pass_z = layer.use_pass_diffuse_direct = True
        layer.cycles.denoising_store_passes = True
    life.cycles.use_denoising = True
    channels = multilayer(life, tmp_path / "layers.exr")
    assert {name.split(".")[0] for name in channels} >= {"A", "B"}
    assert np.abs(channels["A.Combined.R"] - channels["B.Combined.R"]).max() > 0.1
    albedo = channels["A.Denoising Albedo.R"]
    guides = run_job(life, lambda passes: passes.guides(4), layer="A")
    assert np.abs(albedo - guides.albedo[..., 0]).mean() < 0.05
    depth = channels.get("A.Depth.Z", channels.get("A.Depth.V"))
    assert depth.shape == (33, 45)
    assert depth[-1, 0] < depth[20, 0]
    (diffuse,) = [v for k, v in channels.items() if is_diffuse(k, "A", "R")]
    assert diffuse.shape == (33, 45)
    assert diffuse[22:].mean() > 0.01  # no bounce is missing: it is the low picture's
    noisy = channels["A.Noisy Image.R"]  # likewise, enlarged
    assert abs(noisy.mean() / channels["A.Combined.R"].mean() - 1) < 0.1


def is_diffuse(name: str, layer: str, channel: str) -> bool:
    return name in {
        f"{layer}.{kind}.{channel}" for kind in ("DiffDir", "Diffuse Direct")
    }


def test_the_compositor_gets_the_picture(life: Any, network: Any, written: Any) -> None:
    picture = written(life)
    tree, end = compositor(life)
    layers = tree.nodes.new("CompositorNodeRLayers")
    invert = tree.nodes.new("CompositorNodeInvert")
    tree.links.new(layers.outputs["Image"], invert.inputs["Color"])
    tree.links.new(invert.outputs[0], end)
    inverted = written(life)
    np.testing.assert_allclose(inverted[..., :3], 1 - picture[..., :3], atol=1e-5)


def test_the_compositor_gets_the_guides(life: Any, network: Any, written: Any) -> None:
    life.render.engine = "XRDS"
    life.view_layers[0].cycles.denoising_store_passes = True
    tree, end = compositor(life)
    layers = tree.nodes.new("CompositorNodeRLayers")
    assert layers.outputs["Denoising Normal"].enabled
    tree.links.new(layers.outputs["Denoising Albedo"], end)
    picture = written(life)
    call = network[0].calls[0]
    np.testing.assert_allclose(picture[..., :3], call["albedo"], atol=1e-6)
    life.view_layers[0].cycles.denoising_store_passes = False
    life.view_layers[0].update_render_passes()
    sockets = [socket.name for socket in layers.outputs if socket.enabled]
    assert "Denoising Normal" not in sockets


def test_guides_keep_data_passes(life: Any, network: Any, tmp_path: Path) -> None:
    life.view_layers[0].use_pass_z = True
    life.view_layers[0].cycles.denoising_store_passes = True
    channels = multilayer(life, tmp_path / "passes.exr")
    call = network[0].calls[0]
    layer = life.view_layers[0].name
    albedo = channels[f"{layer}.Denoising Albedo.R"]
    np.testing.assert_array_equal(albedo, call["albedo"][..., 0])
    depth = channels.get(f"{layer}.Depth.Z", channels.get(f"{layer}.Depth.V"))
    assert depth[-1, -1] < depth[20, -1]  # not the low picture in a corner


def test_a_picture_tells_what_was_done(life: Any, network: Any) -> None:
    picture = render(life, 2, samples=4, guide_samples=2, seed=5)
    assert picture.radiance.shape == picture.albedo.shape == (33, 45, 3)
    assert picture.low_resolution.shape == (17, 23, 3)
    assert {"total", "sync", "beauty", "guides", "network"} <= picture.seconds.keys()
    parts = sum(v for k, v in picture.seconds.items() if k != "total")
    assert 0 < parts <= picture.seconds["total"]
    assert [d.decision for d in picture.plan][-1] == "sessions"
    again = render(life, 2, samples=4, guide_samples=2, seed=5)
    np.testing.assert_array_equal(again.radiance, picture.radiance)


def test_the_package_name_is_the_function_even_after_its_import(
    life: Any, network: Any
) -> None:
    import xrds_blender

    assert xrds_blender.render(life, 4).radiance.shape == (33, 45, 3)


def test_a_small_network_of_its_own_renders(life: Any, tmp_path: Path) -> None:
    """The real Upscaler behind F12's path, with weights made here."""
    torch = pytest.importorskip("torch")
    from xrds_core.superres.network import XRDS, preset_config

    torch.manual_seed(0)
    save_network(XRDS(preset_config("fast", 2)), tmp_path / "fast_x2.safetensors", {})
    picture = render(life, 2, samples=8, weights=tmp_path)
    assert picture.radiance.shape == (33, 45, 3)
    reference = low_picture(life)
    assert picture.radiance.mean() == pytest.approx(reference.mean(), rel=0.2)


def test_missing_weights_are_one_clear_line(life: Any, tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match="no weights for preset 'paper' at scale 8"):
        render(life, 8, preset="paper", weights=tmp_path)


def test_missing_weights_end_f12_with_an_error_and_no_file(
    life: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from xrds_blender.rendering import loading

    def load(*_: Any) -> None:
        raise WeightsError("no weights, on purpose")

    monkeypatch.setattr(loading, "_load_network", load)
    life.render.engine = "XRDS"
    life.render.filepath = str(tmp_path / "none.png")
    with pytest.raises(RuntimeError, match=r"^Error: no weights, on purpose\n$"):
        bpy.ops.render.render(write_still=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", [{"scale": 3}, {"samples": 0}, {"guide_samples": -1}])
def test_values_out_of_range_are_refused(life: Any, wrong: dict[str, int]) -> None:
    with pytest.raises(UsageError, match=str(next(iter(wrong.values())))):
        render(life, **wrong)


def test_a_clean_render_prints_frames_and_no_warning(
    life: Any, network: Any, written: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    written(life, "CYCLES")
    plain = "".join(capfd.readouterr())
    written(life)
    printed = "".join(capfd.readouterr())
    # Blender 5 as a module prints no frame lines of its own.
    assert ("Fra:" in printed) == ("Fra:" in plain)
    for word in ("Warning", "Error:", "Exception:", "Traceback"):
        assert word not in printed


@pytest.mark.skipif(not BLENDER_5, reason="one working space before Blender 5")
def test_the_network_sees_rec709(life: Any, network: Any, written: Any) -> None:
    from xrds_blender.cycles.colour import converted, to_rec709

    bpy.ops.wm.set_working_color_space(working_space="ACEScg", convert_colors=False)
    picture = render(life, 2, samples=4, seed=1)
    seen = network[0].calls[0]["radiance"]
    expected = converted(picture.low_resolution, to_rec709("ACEScg"))
    np.testing.assert_allclose(seen[..., :3], expected, atol=1e-5)
    low = picture.low_resolution.repeat(2, 0).repeat(2, 1)[:33, :45]
    np.testing.assert_allclose(picture.radiance, low, atol=1e-4)
