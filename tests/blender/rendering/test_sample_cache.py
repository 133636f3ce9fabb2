"""Shots whose samples are kept: rendered in parts, in any order, and never twice."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

from xrds_core import exr

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command import main
from xrds_blender.command.render_file import render_file
from xrds_blender.command.scene_file import SceneChoice
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import full_size
from xrds_core.denoising import Denoiser
from xrds_core.errors import SceneError, UsageError
from xrds_core.shot_files import cameras
from xrds_core.shot_files.frame_file import Reading, read_frame
from xrds_core.shot_files.sequence import Files, denoise_sequence

FRAMES = range(1, 49)
CHUNKS = [range(first, first + 8) for first in (17, 1, 41, 9, 33, 25)]
RADIUS = 2


@pytest.fixture
def blend(life: Any, tmp_path: Path) -> Path:
    """48 tiny frames of a camera that moves past a thing that turns."""
    life.render.resolution_x, life.render.resolution_y = 32, 24
    life.cycles.samples = 1
    thing = next(x for x in life.objects if x.type == "MESH")
    for frame in (1, 48):
        life.camera.location.x = 0.004 * (frame - 24)
        life.camera.keyframe_insert("location", frame=frame)
        thing.rotation_euler.z = 0.01 * frame
        thing.keyframe_insert("rotation_euler", frame=frame)
    return saved(tmp_path)


def saved(folder: Path) -> Path:
    path = folder / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    return path


def render(blend: Path, out: str | None, frames: Any, **more: Any) -> dict[str, Any]:
    job = {"scale": 1, "temporal_radius": RADIUS, "denoise": "fast"}
    pattern = None if out is None else str(blend.parent / out / "##.exr")
    told = render_request(**job | more.pop("job", {}))
    return render_file(blend, pattern, told, frames=list(frames), **more)


def keep(blend: Path, frames: Any, **more: Any) -> dict[str, Any]:
    return render(blend, None, frames, sample_cache=blend.parent / "samples", **more)


def denoise(blend: Path, out: str, frames: Any = None, **more: Any) -> dict[str, Any]:
    folder = blend.parent
    files = Files(
        str(folder / "samples" / "####.exr"), str(folder / out / "##.exr"), True
    )
    return denoise_sequence(files, Denoiser("fast"), frames=frames, **more)


def different(one: Path, two: Path) -> list[int]:
    """Frames that differ in any bit."""
    names = sorted(path.name for path in one.iterdir())
    assert names == sorted(path.name for path in two.iterdir())
    return [int(n[:2]) for n in names if not same(one / n, two / n)]


def same(one: Path, two: Path) -> bool:
    old, new = (exr.File(path) for path in (one, two))
    return old.names.names.keys() == new.names.names.keys() and all(
        np.array_equal(old.pixels(name), new.pixels(name)) for name in old.names.names
    )


@pytest.mark.nightly
def test_parts_of_a_shot_make_the_whole(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With kept samples to the bit; without, frames at chunks' ends are noisier."""
    folder = blend.parent
    render(blend, "whole", FRAMES)
    for chunk in CHUNKS:
        render(blend, "chunks", chunk)
    ends = [n for n in FRAMES if 3 <= n <= 46 and (n - 1) % 8 in {0, 1, 6, 7}]
    assert different(folder / "whole", folder / "chunks") == ends
    for chunk in CHUNKS:
        told = keep(blend, chunk)["samples"]
        assert told["rendered"] == list(chunk)
    monkeypatch.setattr(full_size, "sample_frame", None)  # nothing is rendered any more
    assert keep(blend, FRAMES)["samples"]["read"] == list(FRAMES)
    render(blend, "read", FRAMES, sample_cache=folder / "samples")
    denoise(blend, "denoised")
    for chunk in CHUNKS:
        denoise(blend, "denoised chunks", chunk)
    for name in ("read", "denoised", "denoised chunks"):
        assert not different(folder / "whole", folder / name), name


def chrome(scene: Any, roughness: float = 0.0) -> None:
    """Make all there is of metal, a mirror if it is not rough."""
    material = bpy.data.materials.new("metal")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value = 1.0
    shader.inputs["Roughness"].default_value = roughness
    for each in scene.objects:
        if each.type == "MESH":
            each.data.materials.clear()
            each.data.materials.append(material)


@pytest.mark.parametrize(
    "change",
    [
        lambda scene: scene.camera.animation_data_clear(),
        lambda scene: setattr(scene.render, "film_transparent", True),
        lambda scene: crop(scene.render),
        lambda scene: setattr(scene.camera.data, "type", "ORTHO"),
        lambda scene: around(scene.camera.data, "EQUIRECTANGULAR"),
        lambda scene: setattr(scene.render, "use_motion_blur", True),
        chrome,
        lambda scene: stop_at_noise(scene.cycles),
    ],
    ids=[
        "still camera",
        "transparent film",
        "border",
        "orthographic",
        "panorama",
        "motion blur",
        "mirrors",
        "noise threshold",
    ],
)
def test_whatever_the_scene(blend: Path, change: Callable[[Any], object]) -> None:
    change(bpy.context.scene)
    saved(blend.parent)
    render(blend, "whole", range(1, 7))
    for number in (5, 2, 6, 1, 3, 4):  # each in a task of its own
        keep(blend, [number])
    denoise(blend, "denoised")
    assert not different(blend.parent / "whole", blend.parent / "denoised")


def test_paths_are_rendered_where_something_mirrors(blend: Path) -> None:
    chrome(bpy.context.scene, roughness=0.5)
    saved(blend.parent)
    keep(blend, [1])
    plain = exr.File(blend.parent / "samples" / "0001.exr").names.names
    assert not [name for name in plain if "Denoising Depth" in name]
    chrome(bpy.context.scene)
    saved(blend.parent)
    keep(blend, [1])
    names = exr.File(blend.parent / "samples" / "0001.exr").names.names
    assert [name for name in names if name.endswith("Denoising Depth.Z")]


def stop_at_noise(cycles: Any) -> None:
    """Let pixels differ in their samples."""
    cycles.samples, cycles.use_adaptive_sampling = 40, True
    cycles.adaptive_threshold, cycles.adaptive_min_samples = 0.2, 4


def test_frames_of_other_steps_are_rendered_again(
    blend: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Under a still camera the step decides which part of a sequence a frame takes."""
    scene = bpy.context.scene
    scene.camera.animation_data_clear()
    scene.cycles.use_adaptive_sampling = False
    saved(blend.parent)
    assert keep(blend, [2, 4, 6])["samples"]["rendered"] == [2, 4, 6]
    assert keep(blend, [4, 6, 8])["samples"]["read"] == [4, 6]  # a part of the same
    assert keep(blend, range(2, 5))["samples"]["read"] == []
    assert "of a shot in other steps" in capfd.readouterr().err
    kept = sorted((blend.parent / "samples").glob("*.exr"))
    noise = [read_channels(x)["ViewLayer.Noisy Image.R"].tobytes() for x in kept]
    # 6 was kept in the other step: it has the noise of 3, and they share no samples
    assert len(set(noise)) == len(noise) - 1
    said: list[str] = []
    denoise(blend, "out", say=said.append)
    assert any("frames 3 and 6 share no samples" in line for line in said)


def around(camera: Any, kind: str) -> None:
    """Make the camera a panorama."""
    camera.type = "PANO"
    held = camera if hasattr(camera, "panorama_type") else camera.cycles
    held.panorama_type = kind


def crop(render: Any) -> None:
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.3, 0.9


def test_other_settings_and_other_files_are_rendered_again(
    blend: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    keep(blend, [1])
    assert keep(blend, [1])["samples"]["rendered"] == []
    assert keep(blend, [1], job={"samples": 2})["samples"]["rendered"] == [1]
    assert "frame 1 is rendered again" in capfd.readouterr().err
    for more in (
        {"job": {"seed": 5}},
        {"choice": SceneChoice(resolution=(30, 24))},
        {"choice": SceneChoice(noise_threshold=0.1)},
        {"choice": SceneChoice(noise_threshold=0.2)},
        {"choice": SceneChoice(camera=bpy.context.scene.camera.name)},
    ):
        assert keep(blend, [1], **more)["samples"]["rendered"] == [1]
    keep(blend, [1])
    bpy.context.scene.world.color = (1.0, 0.0, 0.0)
    saved(blend.parent)
    assert keep(blend, [1])["samples"]["rendered"] == [1]


def test_damaged_samples_are_rendered_again(blend: Path) -> None:
    keep(blend, [1, 2])
    path = blend.parent / "samples" / "0002.exr"
    whole = read_channels(path)
    path.write_bytes(path.read_bytes()[:-100])
    assert keep(blend, [1, 2])["samples"]["rendered"] == [2]
    assert all(np.array_equal(x, whole[k]) for k, x in read_channels(path).items())


def test_what_a_kept_file_holds(blend: Path) -> None:
    """Cycles' names, light in half floats, depths in full, OpenEXR's own camera.

    And each pixel's samples, where the file has a noise threshold.
    """
    keep(blend, [7])
    file = exr.File(blend.parent / "samples" / "0007.exr")
    kinds = {name: file.pixels(name).dtype.name for name in file.names.names}
    layer = bpy.context.scene.view_layers[0].name
    for depth in ("Depth", "Denoising Depth"):
        assert kinds.pop(f"{layer}.{depth}.Z") == "float32"
    assert set(kinds.values()) == {"float16"}
    passes = {name.rpartition(".")[0] for name in kinds}
    names = ("Noisy Image", "Denoising Albedo", "Denoising Normal", "Vector")
    assert passes == {
        f"{layer}.{name}" for name in (*names, "XRDS Noise", "XRDS Samples")
    }
    told = file.parts[0].attributes
    assert told["xrds/samples"] == 1
    scene = bpy.context.scene
    scene.frame_set(7)
    view = np.diag([1, 1, -1, 1]) @ np.array(scene.camera.matrix_world.inverted())
    np.testing.assert_allclose(np.transpose(told["worldToCamera"]), view, atol=1e-6)
    # the file's own NDC shows what the camera looks at in the middle of the picture
    ahead = scene.camera.matrix_world @ type(scene.camera.location)((0, 0, -3))
    x, y, _, w = np.array([*ahead, 1.0]) @ np.array(told["worldToNDC"])
    np.testing.assert_allclose([x / w, y / w], [0.5, 0.5], atol=1e-5)


def test_cameras_of_a_file_are_those_of_its_samples(blend: Path) -> None:
    """For frames that plain Cycles has rendered, whose headers tell no camera."""
    bpy.context.scene.camera.data.shift_x = 0.1
    saved(blend.parent)
    keep(blend, [5])
    told = blend.parent / "cameras.json"
    assert main.main(["cameras", str(blend), "-o", str(told), "--frames", "4-6"]) == 0
    known = cameras.read_cameras(told)
    assert list(known) == [4, 5, 6]
    ours = cameras.camera_of_frame(known, 5, (32, 24))
    path = blend.parent / "samples" / "0005.exr"
    theirs = read_frame(path, 5, Reading()).stored.camera
    assert ours is not None
    np.testing.assert_allclose(ours.view, theirs.view, atol=1e-6)
    np.testing.assert_array_equal(ours.project, theirs.project)
    assert ours.name == theirs.name


def test_a_killed_render_is_resumed(blend: Path) -> None:
    """Nothing that was sampled is rendered again, and the frames are the same."""
    folder = blend.parent
    frames = range(1, 13)
    render(blend, "whole", frames)
    words = f"render {blend} -o {folder}/out/##.exr --scale 1 --frames 1-12 --resume"
    words += f" --sample-cache {folder}/samples --temporal-radius 2 --denoise fast"
    code = "import sys, xrds_blender.command.main as m; m.program()"
    child = subprocess.Popen(
        [sys.executable, "-c", code, *words.split()],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not list((folder / "out").glob("0[3-9].exr")):
        assert child.poll() is None
        time.sleep(0.005)
    child.send_signal(signal.SIGKILL)
    child.wait()
    there = sorted(int(x.stem) for x in (folder / "samples").glob("[0-9]*.exr"))
    assert there
    assert main.main([*words.split(), "--json"]) == 0
    told = keep(blend, frames)["samples"]
    assert told["read"] == list(frames)
    assert not different(folder / "whole", folder / "out")


def test_a_failed_frame_is_rendered_again_by_itself(blend: Path) -> None:
    """What a wrangler does: the last step tells of it, then one frame and --resume."""
    keep(blend, [1, 2, 4, 5])
    said: list[str] = []
    told = denoise(blend, "out", range(1, 6), say=said.append)
    assert [each["frame"] for each in told["left_out"]] == [3]
    assert any("frames 3" in line for line in said)
    keep(blend, [3])
    told = denoise(blend, "out", range(1, 6), resume=True)
    # those beside it, too: they lacked its samples
    assert [each["frame"] for each in told["frames"]] == [1, 2, 3, 4, 5]
    assert told["frames"][2]["temporal"]["frames"] == (1, 2, 3, 4, 5)
    assert not denoise(blend, "out", range(1, 6), resume=True)["frames"]


def test_samples_come_from_beyond_a_chunk(blend: Path) -> None:
    keep(blend, [3, 4])
    told = render(blend, "out", [5, 6], sample_cache=blend.parent / "samples")
    assert told["frames"][0]["temporal"]["frames"] == (3, 4, 5, 6)
    assert told["samples"]["rendered"] == [5, 6]


@pytest.mark.parametrize(
    "more",
    [{"scale": 2}, {"plain": True}, {"time_budget": 3.0}, {"temporal_radius": 0}],
    ids=str,
)
def test_what_keeps_no_samples(blend: Path, more: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="--sample-cache needs"):
        keep(blend, [1], job=more)


def test_a_fisheye_keeps_no_samples(blend: Path) -> None:
    around(bpy.context.scene.camera.data, "FISHEYE_EQUISOLID")
    saved(blend.parent)
    with pytest.raises((UsageError, SceneError), match="reuse"):
        keep(blend, [1])


def test_the_command(blend: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = blend.parent
    words = f"render {blend} --scale 1 --frame 2 --sample-cache {folder}/samples"
    assert main.main(words.split()) == 0
    out, err = capfd.readouterr()
    assert f"{folder}/samples: samples of 1 frames rendered, 0 were there" in out
    assert "frame 2: samples cached" in err
    told = exr.File(folder / "samples" / "0002.exr").parts[0].attributes
    assert told["xrds/radius"] == 4  # though it is one frame
    words = f"denoise {folder}/samples/####.exr -o {folder}/out/####.exr --frames 1-2"
    assert main.main(words.split()) == 1
    assert "frames 1 could not be finished" in capfd.readouterr().err
    assert (folder / "out" / "0002.exr").is_file()
