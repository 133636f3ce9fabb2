"""Shots above scale 1: light and guides of neighbouring frames, and the network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")
torch = pytest.importorskip("torch")

from xrds_blender import run_job
from xrds_blender.command.render_file import render_file
from xrds_blender.cycles.passes import CyclesPasses
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import shot, super_resolution
from xrds_blender.rendering.render import method_of
from xrds_core.errors import XRDSError
from xrds_core.superres.upscaler import Upscaler

FRAMES = [1, 2, 3, 4, 5]
pytestmark = pytest.mark.usefixtures("one_thread")


def save(life: Any, path: Path) -> Path:
    life.render.resolution_x, life.render.resolution_y = 65, 47
    life.cycles.samples = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def moving(life: Any, tmp_path: Path) -> Path:
    """The still life under a camera that moves, at an odd size, one sample."""
    for frame in (1, 5):
        life.camera.location.x = 0.05 * (frame - 3)
        life.camera.keyframe_insert("location", frame=frame)
    return save(life, tmp_path / "moving.blend")


@pytest.fixture
def lit(life: Any, tmp_path: Path) -> Path:
    """The still life under a still camera; the lamp, which no mirror shows, changes."""
    bpy.data.lights["Lamp"].type = "POINT"
    lamp = bpy.data.lights["Lamp"]
    lamp.shadow_soft_size = 0.0
    life.cycles.use_adaptive_sampling = False
    for frame in (1, 5):
        lamp.energy = 100 * frame
        lamp.keyframe_insert("energy", frame=frame)
    return save(life, tmp_path / "lit.blend")


def render(blend: Path, out: str, **more: Any) -> dict[str, Any]:
    job = {"scale": 2, "guide_samples": 1, "temporal_radius": 2} | more.pop("job", {})
    pattern = str(blend.parent / out / "#.exr")
    return render_file(
        blend, pattern, render_request(**job), **{"frames": FRAMES, **more}
    )


def picture(path: Path) -> np.ndarray:
    channels = read_channels(path)
    names = [next(n for n in channels if n.endswith(c)) for c in "RGB"]
    return np.dstack([channels[name] for name in names])


def test_light_and_guides_of_neighbours_make_a_better_picture(moving: Path) -> None:
    render(moving, "alone", job={"temporal_radius": 0})
    result = render(moving, "shot")
    bpy.ops.wm.open_mainfile(filepath=str(moving))
    bpy.context.scene.frame_set(3)
    whole = run_job(bpy.context.scene, lambda p: p.beauty(1, 256, denoise=False))

    def error(name: str) -> float:
        found = np.clip(picture(moving.parent / name / "3.exr"), 0, 1)
        return float(np.square(found - np.clip(whole.radiance, 0, 1)).mean())

    assert error("shot") < 0.8 * error("alone")
    temporal = result["frames"][2]["temporal"]
    assert temporal["frames"] == (1, 2, 3, 4, 5)
    assert 2.0 < temporal["mean_samples"] <= 5.0
    decisions = {each["decision"]: each["value"] for each in result["plan"]}
    assert decisions["accumulation"] == "frames 3 to 5"


def test_the_light_of_a_pixel_lies_where_it_is_seen(moving: Path) -> None:
    """Low-resolution pixels cover more than the frame: the camera knows it."""
    bpy.ops.wm.open_mainfile(filepath=str(moving))
    seen = []

    def look(passes: CyclesPasses) -> None:
        low = passes.low_samples(2, 1)[""]
        window = low.place.window
        seen.append((window.x, window.y, *low.samples.picture.shape))

    run_job(bpy.context.scene, look)
    assert seen == [(0, 0, 24, 33, 4)]


def test_guides_of_what_stands_still_are_rendered_a_few_times(
    lit: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_subsets(bpy.context.scene):
        pytest.skip("this Blender continues no sequence")
    rendered = []
    samples = []
    guides = CyclesPasses.guides_by_view
    gather = super_resolution.accumulated_guides

    def count(passes: CyclesPasses, *given: Any, **named: Any) -> Any:
        rendered.append(named["subset"].offset)
        return guides(passes, *given, **named)

    def look(*given: Any) -> Any:
        found = gather(*given)
        samples.append(found.samples)
        return found

    monkeypatch.setattr(CyclesPasses, "guides_by_view", count)
    monkeypatch.setattr(super_resolution, "accumulated_guides", look)
    render(lit, "shot", job={"temporal_radius": 1}, frames=[1, 2, 3, 4, 5, 6])
    assert sorted(rendered) == [0, 1, 2]  # and frames 4 to 6 take what is there
    assert samples == [2, 3, 3, 3, 3, 3]


def rendered_guides(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the frames whose guides are rendered from now on."""
    frames: list[int] = []
    guides = CyclesPasses.guides_by_view

    def count(passes: CyclesPasses, *given: Any, **named: Any) -> Any:
        frames.append(bpy.context.scene.frame_current)
        return guides(passes, *given, **named)

    monkeypatch.setattr(CyclesPasses, "guides_by_view", count)
    return frames


def test_where_only_the_camera_moves_every_second_frame_has_guides(
    moving: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = rendered_guides(monkeypatch)
    result = render(moving, "shot", frames=[1, 2, 3, 4])
    assert frames == [1, 3, 4]
    assert [d["value"] for d in result["plan"] if d["decision"] == "guides"] == [
        "rendered"
    ]
    frames.clear()
    render(moving, "all", frames=[1, 2, 3, 4], job={"savings": ()})
    assert frames == [1, 2, 3, 4]
    saved, whole = (picture(moving.parent / n / "2.exr") for n in ("shot", "all"))
    assert np.abs(saved - whole).mean() < 0.02 * whole.mean()


def test_where_things_move_every_frame_has_guides(
    moving: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cube = bpy.data.objects["Red"]
    for frame in (1, 5):
        cube.location.x = -1.0 - 0.2 * frame
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.wm.save_mainfile()
    frames = rendered_guides(monkeypatch)
    render(moving, "shot", frames=[1, 2, 3])
    assert frames == [1, 2, 3]


def test_views_that_swing_away_have_guides_of_their_own(
    moving: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a turntable in large steps: what lies beside is another take."""
    camera = bpy.context.scene.camera
    for frame in range(1, 6):
        camera.rotation_euler.z = 1.5 * (frame - 2)
        camera.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.wm.save_mainfile()
    frames = rendered_guides(monkeypatch)
    render(moving, "shot", frames=[1, 2, 3])
    assert sorted(frames) == [1, 2, 3]


@pytest.fixture
def animation(moving: Path) -> Any:
    bpy.ops.wm.open_mainfile(filepath=str(moving))
    scene = bpy.context.scene
    scene.render.engine = "XRDS"
    scene.xrds.mode, scene.xrds.temporal_radius = "x2", 2
    scene.xrds.guide_samples = 1
    scene.frame_start, scene.frame_end = 1, 5
    scene.view_layers[0].use_pass_diffuse_direct = True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(moving.parent / "f12" / "#.exr")
    return scene


def layer(path: Path, name: str, letters: str = "RGB") -> np.ndarray:
    found = read_channels(path)
    names = [next(n for n in found if n.endswith(f"{name}.{c}")) for c in letters]
    return np.dstack([found[each] for each in names])


@pytest.mark.parametrize("passes", [False, True])
def test_an_enlarged_animation_is_the_shot_of_the_command(
    animation: Any, moving: Path, monkeypatch: pytest.MonkeyPatch, passes: bool
) -> None:
    """Passes that come with the guides need them in every frame."""
    layer_settings = animation.view_layers[0]
    layer_settings.use_pass_diffuse_direct = layer_settings.use_pass_normal = passes
    layer_settings.use_pass_z = False
    bpy.ops.wm.save_mainfile()
    frames = rendered_guides(monkeypatch)
    bpy.ops.render.render(animation=True)
    assert len(frames) == (5 if passes else 3)
    render(moving, "command")
    for number in FRAMES:
        path = moving.parent / "f12" / f"{number}.exr"
        theirs = picture(moving.parent / "command" / f"{number}.exr")
        np.testing.assert_allclose(layer(path, "Combined"), theirs, atol=2e-3)
        if passes:
            # light passes are of the low-resolution render, at the picture's size
            name = "DiffDir" if bpy.app.version < (5,) else "Diffuse Direct"
            light = layer(path, name)
            assert 0.2 < light[24:, 33:].mean() / light[24:, :33].mean() < 5.0


@pytest.mark.parametrize(
    "stage",
    ["Low resolution of frame 1", "Guides of frame 1", "Guides of frame 3", "Network"],
)
def test_a_stopped_frame_shows_its_own_light(
    animation: Any, moving: Path, stopped_in: Callable[[str], None], stage: str
) -> None:
    """Enlarged without the network. Blender knows of no stop, so it saves the frame."""
    for frame in (1, 5):
        animation.camera.location.x = 0.5 * (frame - 3)
        animation.camera.keyframe_insert("location", frame=frame)
    animation.frame_end = 3
    stopped_in(stage)
    kept = layer(moving.parent / "f12" / "1.exr", "Combined")
    errors = []
    for number in (1, 3):
        animation.frame_set(number)
        true = run_job(animation, lambda p: p.beauty(1, 64, denoise=False)).radiance
        errors.append(np.abs(kept - true).mean())
    assert errors[0] < 0.6 * errors[1]


def test_what_was_rendered_is_kept_where_the_network_fails(
    moving: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("no room")

    monkeypatch.setattr(Upscaler, "__call__", fail)
    with pytest.raises(XRDSError, match=r"frame 1: the network failed.*1_low\.exr"):
        render(moving, "shot")
    low = moving.parent / "shot" / "1_low.exr"
    assert picture(low).shape == (24, 33, 3)


def test_how_much_neighbours_count(moving: Path, network: list[Any]) -> None:
    """Both light and guides have as much of them."""
    bpy.ops.wm.open_mainfile(filepath=str(moving))
    scene = bpy.context.scene
    method = method_of(render_request(2, guide_samples=1, temporal_radius=1))
    first, own, last = (shot._sample(scene, method, [1, 2, 3], n) for n in (1, 2, 3))
    samples = []
    for strength in (0.0, 0.5, 1.0):
        weak = replace(own, strength=strength)
        made = method.finish(weak, [first, last], "", lambda _: True)
        samples.append(made.temporal.mean_samples)
    method.finish(own, [], "", lambda _: True)
    assert samples[0] == 1.0
    assert 1.2 < samples[1] < 0.8 * samples[2]
    none, half, whole, alone = network[0].calls
    for name in ("radiance", "albedo"):
        assert np.array_equal(none[name], alone[name])
        assert not np.array_equal(half[name], whole[name])
        assert not np.array_equal(half[name], alone[name])
