"""The demo's scene, its shot and its pictures."""

from __future__ import annotations

import json
import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from PIL import Image

from xrds_lab.demo import __main__ as demo
from xrds_lab.demo import comparison, contest, film, results, scene
from xrds_lab.demo.countdown import Countdown
from xrds_lab.demo.scene import MIDDLE, PIVOT, SHOT, TURN, build, orbit
from xrds_lab.shots import film as pictures

pytestmark = pytest.mark.nightly  # it takes minutes

TOP = comparison.HEADING + comparison.LABEL


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


def test_the_shot_circles_about_what_it_looks_at() -> None:
    scene = build(64, 36)
    bpy.context.view_layer.update()
    built = scene.camera.matrix_world.copy()
    orbit(scene)
    spots, ways = [], []
    for number in SHOT:
        scene.frame_set(number)
        spots.append(world_to_camera_view(scene, scene.camera, Vector(PIVOT)))
        ways.append(scene.camera.matrix_world.copy())
    middle = np.array(ways[SHOT.index(MIDDLE)])
    assert np.allclose(middle, np.array(built), atol=1e-5)
    for spot in spots:
        assert tuple(spot.xy) == pytest.approx((0.5, 0.5), abs=1e-4)
    turned = ways[0].to_quaternion().rotation_difference(ways[-1].to_quaternion())
    assert math.degrees(turned.angle) == pytest.approx(TURN * (len(SHOT) - 1), rel=0.01)


def test_comparison_shows_every_column(tmp_path: Path) -> None:
    bright = np.full((540, 960, 3), 0.9, np.float32)
    dark = np.zeros((540, 960, 3), np.float32)
    path = tmp_path / "comparison.png"
    comparison.compare("two", [("bright", bright), ("dark", dark)], path)
    sheet = np.asarray(Image.open(path), np.float32)
    rows, columns = sheet[TOP + 10 :, :, 0].shape
    left = sheet[TOP + 10, comparison.GAP + 10, 0]
    right = sheet[TOP + 10, columns - comparison.GAP - 10, 0]
    assert left > 240
    assert right == 0
    assert rows > (len(comparison.SPOTS) - 1) * comparison.CROP[1] * comparison.ZOOM


def test_crops_lie_inside_small_pictures(tmp_path: Path) -> None:
    small = np.full((90, 140, 3), 0.5, np.float32)
    comparison.compare("one", [("small", small)], tmp_path / "small.png")
    sheet = np.asarray(Image.open(tmp_path / "small.png"))
    pitch = comparison.CROP[1] * comparison.ZOOM + comparison.GAP
    crops = sheet[TOP + 5 :: pitch, comparison.GAP + 5, 0]
    assert len(crops) == len(comparison.SPOTS)
    assert (crops > 100).all()


def test_film_moves_both_shots(tmp_path: Path) -> None:
    path = tmp_path / "shot.webp"
    light = [np.full((120, 300, 3), level, np.float32) for level in (0.1, 0.5, 0.9)]
    dark = [np.zeros((120, 300, 3), np.float32)] * 3
    comparison.move((light, dark), ("light\n1 dB", "dark\n2 dB"), path)
    with Image.open(path) as shown:
        assert shown.n_frames == 4  # there and back
        levels = []
        for number in range(3):
            shown.seek(number)
            pixels = np.asarray(shown.convert("RGB"), np.float32)[comparison.LABEL :]
            levels.append(pixels[:, :40].mean())
            assert pixels[:, -40:].mean() < 10
    assert levels[0] + 30 < levels[1] < levels[2] - 30


def test_films_stay_small_where_that_costs_quality(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    noise = [random.integers(0, 255, (80, 80, 3), np.uint8) for _ in range(3)]
    frames = [Image.fromarray(picture) for picture in noise]
    fine, small = tmp_path / "fine.webp", tmp_path / "small.webp"
    pictures.save(fine, frames)
    pictures.save(small, frames, fine.stat().st_size - 1)
    assert small.stat().st_size < fine.stat().st_size


def test_samples_fit_into_the_seconds_that_are_left() -> None:
    assert contest.fitting(2.2, 1.0, 0.5) == 2
    assert contest.fitting(0.5, 1.0, 0.5) == 1


def test_countdown_tells_task_and_time(capsys: pytest.CaptureFixture[str]) -> None:
    with Countdown(59.6) as countdown:
        countdown.say("first")
        countdown.needs(125.4)
        countdown.say("second")
        assert countdown.left == pytest.approx(125.4, abs=1.0)
        countdown.needs(1.0)
        assert countdown.left > 100
    assert Countdown(0.0).left == 0
    told = capsys.readouterr().err.splitlines()
    assert told == ["demo: 1:00 left: first", "demo: 2:05 left: second"]


def test_demo_leaves_figures_pictures_and_the_scene(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (scene, contest, results):  # three frames instead of nine
        monkeypatch.setattr(module, "SHOT", range(4, 7))
    options = ["--out", str(tmp_path), "--resolution", "48x28", "--seconds", "1"]
    assert demo.main([*options, "--samples", "3"]) == 0
    report = json.loads((tmp_path / "results.json").read_text())
    rows = {row["way"]: row for row in report["ways"]}
    assert list(rows) == [
        "cycles_oidn_default",
        "cycles_oidn_quick",
        "xrds_x2",
        "xrds_x1",
        "xrds_shot",
    ]
    assert rows["xrds_shot"]["samples"] == 3
    assert report["settings"]["frames"] == 3
    assert all(row["seconds_per_frame"] > 0 for row in rows.values())
    assert all(10 < row["psnr"] < 60 for row in rows.values())
    moving = {name for name, row in rows.items() if row["flicker"] is not None}
    assert moving == {"cycles_oidn_default", "cycles_oidn_quick", "xrds_shot"}
    for name in (*results.PICTURES, "reference.exr", "xrds_shot.png"):
        assert (tmp_path / name).stat().st_size > 0, name
    told = [line for line in capfd.readouterr().out.splitlines() if " dB" in line]
    assert [line.split(",")[0] for line in told[:2]] == ["Cycles + OIDN"] * 2
    assert len(told) == len(rows)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "still_life.blend"))
    assert bpy.context.scene.camera.animation_data.action is not None


@pytest.mark.parametrize(("fixed", "each"), [(2.0, 0.61), (9.0, 0.61), (0.4, 2.0)])
def test_films_have_samples_of_equal_seconds(fixed: float, each: float) -> None:
    cycles, ours = film.Line(4.0, each), film.Line(fixed, each)
    samples = film.equal_samples(cycles, ours, 16)
    assert ours.at(samples[1]) == pytest.approx(cycles.at(samples[0]), rel=0.02)
    assert abs(samples[0] - 16) <= 4


def test_a_film_shows_both_in_the_samples_chosen(blend: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 10
    bpy.ops.wm.save_mainfile()
    asked = [str(blend), "-o", str(tmp_path), "--samples", "2"]
    asked += ["--resolution", "48x32", "--part", "24x16+20+10", "--stops", "1"]
    assert film.main(asked) == 0
    report = json.loads((tmp_path / "film.json").read_text())
    assert [row["way"] for row in report["ways"]] == ["Cycles + OIDN", "XRDS"]
    assert report["ratio"] > 0.0
    with Image.open(tmp_path / "film.webp") as picture:
        assert picture.n_frames == 10
        assert picture.height == comparison.LABEL + 64  # the part is as high again


@pytest.mark.parametrize("part", ["24x15+0+0", "24x16+30+0", "24x16-1+0", "60x40+0+0"])
def test_a_part_that_does_not_fit_is_refused_before_rendering(
    part: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    asked = [str(tmp_path / "a.blend"), "-o", str(tmp_path / "out")]
    asked += ["--resolution", "48x32", f"--part={part}"]
    assert film.main(asked) == 2
    assert f"--part {part} does not fit 48x32 pixels" in capfd.readouterr().err
    assert not (tmp_path / "out").exists()
