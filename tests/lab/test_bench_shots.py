"""The measure of shots over one scene of a few pixels: made, resumed, judged."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from xrds_blender import run_job
from xrds_blender.command import main
from xrds_blender.cycles.samples import sample_layer
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.settings import CYCLES_DENOISING
from xrds_blender.rendering.blender_job import call_engine
from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame, Halves
from xrds_core.arrays import Array
from xrds_core.errors import SceneError, UsageError
from xrds_lab.bench.inputs import Folder
from xrds_lab.bench.windows import Window, find_shots
from xrds_lab.shots import bench, blocks, figures, film, motions, rivals
from xrds_lab.shots.bench import Measure, bench_shots
from xrds_lab.shots.frames import MIDDLE, ShotFrames, requests
from xrds_lab.shots.methods import BEST, DEFAULT, MEDIAN, NL_MEANS, XRDS
from xrds_lab.shots.nl_means import nl_means
from xrds_lab.shots.seeds import over_seeds

pytestmark = pytest.mark.nightly  # it takes minutes

SIZE = (48, 36)
WINDOW = Window(*SIZE, 0, 0, *SIZE)


def run(blend: Path, out: str = "out", **more: Any) -> dict[str, Any]:
    choices = {"motions": ("pan",), "radii": (0, 1)} | more
    return bench_shots(
        [blend],
        blend.parent / out,
        Measure(**choices),
        resolution=SIZE,
        cache=blend.parent / "cache",
        reference_samples=16,
    )


def gain(points: list[dict[str, Any]], motion: str, radius: int) -> float:
    found = {
        (p["method"], p["radius"]): p["psnr"] for p in points if p["motion"] == motion
    }
    return float(found[XRDS, radius] - found[DEFAULT, 0])


def test_a_second_run_renders_nothing_and_gives_the_same_files(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"motions": ("pan", "still"), "films": True}
    first = run(blend, radii=(0, 1, 4), **asked)
    assert first["failures"] == {}
    points = first["shots"]
    cases = {(p["motion"], p["method"], p["radius"]) for p in points}
    methods = [(DEFAULT, 0), (BEST, 0), (MEDIAN, 1), (NL_MEANS, 1)]
    methods += [(XRDS, radius) for radius in (0, 1, 4)]
    assert cases == {(m, *x) for m in ("pan", "still") for x in methods}
    assert all(p["flicker"] > 0 and 0 < p["flip"] < 1 for p in points)
    for motion in ("pan", "still"):
        assert gain(points, motion, 4) > gain(points, motion, 1) > 0.5
    out = blend.parent / "out"
    assert json.loads((out / "results.json").read_text()) == first
    with (out / "results.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == len(points)
    assert "| pan, 2 | 1 | +" in (out / "report.md").read_text()
    assert len(list(out.glob("best-cubes-*-2spp.webp"))) == 1
    crops = list((blend.parent / "cache").glob("*-crop-*.webp"))
    assert len(crops) == len(points) + 2  # the references of two motions
    assert (out / "report.html").read_text().count("data:image/webp") > 2

    def refuse(*_: Any) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(ShotFrames, "_render", refuse)
    monkeypatch.setattr(figures, "metrics_of_pair", refuse)
    # what an earlier call has measured stays in the report
    again = run(blend, "again", radii=(0,), **(asked | {"films": False}))
    assert again == first
    for name in ("results.json", "results.csv", "report.md", "report.html"):
        assert (out / name).read_bytes() == (blend.parent / "again" / name).read_bytes()


def test_longer_shots_and_seconds_join_the_report(blend: Path) -> None:
    asked = {"radii": (0, 5), "rounds": 1, "samples": (2, 4, 6)}
    asked["seconds_samples"] = (2, 6)
    result = run(blend, seconds=True, seconds_at=(48, 32), **asked)
    assert result["failures"] == {}
    few = [p for p in result["shots"] if p["samples"] == 2]
    found = {(p["method"], p["radius"]): p for p in few}
    assert found[XRDS, 5]["psnr"] > found[XRDS, 0]["psnr"] + 1.0
    assert found[XRDS, 5]["flicker"] < found[XRDS, 0]["flicker"]
    timed = [
        found[x]["seconds_per_frame"] for x in ((XRDS, 0), (XRDS, 5), (DEFAULT, 0))
    ]
    assert all(0.0 < seconds < 60.0 for seconds in timed)
    (path,) = (blend.parent / "cache").glob("*-shot-seconds.json")
    known = json.loads(path.read_text())
    name = f"{XRDS}-5"
    assert known.keys() == {"2", "6"}
    # frames of 6 are finished as those of 2
    assert known["6"][name]["finish"] == known["2"][name]["finish"]
    assert known["6"][name]["total"] == pytest.approx(
        known["6"][name]["sample"]["total"] + known["2"][name]["finish"]["total"]
    )
    point = {p["samples"]: p for p in result["shots"] if p["method"] == DEFAULT}
    few, half, many = (point[n]["seconds_per_frame"] for n in (2, 4, 6))
    assert half == pytest.approx((few + max(few, many)) / 2)  # on the line
    assert "Of frames of 48x32" in (blend.parent / "out/report.md").read_text()
    drawn = (blend.parent / "out/error-pan.svg").read_text()
    assert "XRDS, radius 4" not in drawn  # only what was timed
    assert "Cycles + OIDN" in drawn


def test_another_seed_is_other_noise_of_the_same_shot(blend: Path) -> None:
    asked = {"motions": ("still",), "radii": (0,)}
    first = run(blend, **asked)["shots"]
    kept = [path.name for path in (blend.parent / "cache").glob("*noisy-2spp*")]
    assert len(kept) == 9
    assert not any("seed" in name for name in kept)
    both = run(blend, seeds=2, **asked)["shots"]
    assert [p for p in both if p["seed"] == 0] == first
    again = {p["method"]: p["psnr"] for p in both if p["seed"] == 1}
    assert again.keys() == {p["method"] for p in first}
    for point in first:
        assert again[point["method"]] != point["psnr"]
        assert again[point["method"]] == pytest.approx(point["psnr"], abs=3.0)
    means = {p["method"]: p for p in over_seeds(both)}
    for point in first:
        mean = means[point["method"]]
        assert mean["psnr"] == pytest.approx(
            (point["psnr"] + again[point["method"]]) / 2
        )
        assert mean["seeds"] == 2
    crops = list((blend.parent / "cache").glob("*-crop-*.webp"))
    assert len(crops) == len(first) + 1  # other noise of the same place tells no more


def test_a_file_moves_as_it_says_around_its_current_frame(blend: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    for frame, x in ((1, -0.5), (41, 0.5)):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)
    scene.frame_set(21)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    result = run(blend, motions=(motions.FILE,), radii=(0, 4))
    assert result["failures"] == {}
    assert {p["motion"] for p in result["shots"]} == {"file"}
    assert gain(result["shots"], "file", 4) > 0.5
    assert all(p["flicker"] > 0 for p in result["shots"])
    (shot,) = find_shots([blend], None, None, SIZE)
    frames = ShotFrames(shot, Folder(blend.parent / "cache"))
    made = [frames.frame(r) for r in requests(motions.FILE, 2, 4)]
    at = {f.number: np.linalg.inv(f.camera.view)[0, 3] for f in made}
    assert sorted(at) == list(range(17, 26))
    assert at[21] == pytest.approx(0.0, abs=1e-6)
    assert at[17] < at[21] < at[25]


def test_a_shot_that_cannot_be_made_leaves_the_others(blend: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    for name in ("Red", "Mirror"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    result = run(blend, motions=("objects", "pan"), radii=(0,))
    assert {p["motion"] for p in result["shots"]} == {"pan"}
    assert any("no small object" in why for why in result["failures"].values())
    assert "no small object" in (blend.parent / "out/report.md").read_text()


def test_what_cannot_be_measured_is_wrong_usage() -> None:
    with pytest.raises(UsageError, match="samples"):
        Measure(samples=(0,))
    with pytest.raises(UsageError, match="radii"):
        Measure(radii=(-1,))
    with pytest.raises(UsageError, match="seeds 0"):
        Measure(seeds=0)


def test_the_command_passes_on_what_is_measured(
    blend: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def note(scenes: Any, out: Path, measure: Measure, **_: Any) -> dict[str, Any]:
        asked.append(measure)
        return {"shots": [], "failures": {}}

    monkeypatch.setattr(bench, "bench_shots", note)
    given = ["bench", "shots", str(blend), "-o", str(tmp_path), "--samples", "4"]
    assert main.main([*given, "--seeds", "3"]) == 0
    assert main.main(given) == 0
    assert [(m.samples, m.seeds) for m in asked] == [((4,), 3), ((4,), 1)]


# --- blocks ---------------------------------------------------------------------------


def test_a_block_that_loses_is_found_in_a_picture_that_gains() -> None:
    noise = np.random.default_rng(0).normal(0, 0.01, (4, 96, 128, 3))
    alone, picture, *truth = (
        0.3 + noise * [[[[4]]], [[[1]]], [[[1]]], [[[1]]]]
    ).astype(np.float32)
    good = blocks.against_alone(picture, alone, truth, 0.0)
    assert good["gain_over_alone"] > 6.0
    assert good["worst_block"] > 6.0
    assert good["share_of_blocks"] == 0.0
    picture[32:64, 64:96] += 0.1
    bad = blocks.against_alone(picture, alone, truth, 0.0)
    assert bad["worst_block"] < -2.0
    assert bad["share_of_blocks"] == pytest.approx(1 / 12, abs=1e-4)
    points = [
        {"scene": s, "motion": "pan", "samples": 2, "radius": 4, **x}
        for s, x in (("good", good), ("bad", bad))
    ]
    text = "\n".join(blocks.section(points))
    assert f"| {bad['worst_block']:+.2f} bad | 4.2% | 8.3% bad |" in text
    assert not list(blocks.section([{"scene": "good"}]))


# --- motions --------------------------------------------------------------------------


def places(scene: Any, name: str, frames: list[int]) -> list[np.ndarray]:
    found = []
    for frame in frames:
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        found.append(np.array(graph.objects[name].matrix_world))
    return found


@pytest.mark.parametrize("motion", list(motions.MADE))
def test_the_middle_frame_is_the_files_own_view(
    still_life: Callable[..., Any], motion: str
) -> None:
    scene = still_life()
    arm = bpy.data.objects.new("arm", None)
    scene.collection.objects.link(arm)
    scene.camera.parent = arm  # the file's camera moves by another thing
    for frame, x in ((1, 0.0), (21, 4.0)):
        arm.location.x = x
        arm.keyframe_insert("location", frame=frame)
        for name in ("Red", "Mirror"):
            thing = scene.objects[name]
            thing.location.z = 1.0 + 0.1 * frame
            thing.keyframe_insert("location", frame=frame)
    scene.frame_set(11)
    names = ("Camera", "Red", "Mirror")
    before = {name: places(scene, name, [11])[0] for name in names}
    moved = motions.animate(scene, WINDOW, motion, MIDDLE, 4)
    assert bool(moved) == (motion in {"objects", "both"})
    expected = {"Camera": motion in {"pan", "fast", "both"}}
    expected |= {name: name in moved for name in names[1:]}
    for name in names:
        first, middle, last = places(scene, name, [MIDDLE - 4, MIDDLE, MIDDLE + 4])
        assert middle == pytest.approx(before[name], abs=1e-5)
        assert (np.abs(last - first).max() > 1e-3) == expected[name]
    assert not scene.render.use_motion_blur


def test_objects_move_three_pixels_a_frame(still_life: Callable[..., Any]) -> None:
    scene = still_life()
    window = Window(480, 360, 0, 0, 480, 360)
    window.apply(scene)
    (name, *_) = motions.animate(scene, window, "objects", MIDDLE, 4)
    here, there = (x[:3, 3] for x in places(scene, name, [MIDDLE, MIDDLE + 1]))
    graph = bpy.context.evaluated_depsgraph_get()
    project = scene.camera.calc_matrix_camera(graph, x=480, y=360)
    view = project @ scene.camera.matrix_world.inverted()
    shown = [(view @ Matrix.Translation(x)).translation for x in (here, there)]
    depth = [(view @ Matrix.Translation(x))[3][3] for x in (here, there)]
    pixels = [480 / 2 * x[0] / w for x, w in zip(shown, depth, strict=True)]
    assert pixels[1] - pixels[0] == pytest.approx(3.0, rel=0.25)


def test_an_instance_moves_by_what_instances_it(
    still_life: Callable[..., Any],
) -> None:
    scene = still_life()
    hidden = bpy.data.collections.new("wheels")
    for name in ("Red", "Mirror"):
        thing = scene.objects[name]
        scene.collection.objects.unlink(thing)
        hidden.objects.link(thing)
    for name, x in (("left", -0.5), ("right", 0.5)):
        carrier = bpy.data.objects.new(name, None)
        carrier.instance_type, carrier.instance_collection = "COLLECTION", hidden
        carrier.scale, carrier.location.x = (0.3, 0.3, 0.3), x
        scene.collection.objects.link(carrier)
    moved = motions.animate(scene, WINDOW, "objects", MIDDLE, 4)
    assert set(moved) <= {"left", "right"}
    assert moved


def test_a_window_without_small_objects_says_so(
    empty_scene: Callable[..., Any],
) -> None:
    with pytest.raises(SceneError, match="shows no small object"):
        motions.animate(empty_scene(*SIZE, 1), WINDOW, "objects", MIDDLE, 4)


# --- rivals and figures ---------------------------------------------------------------


def test_cycles_denoiser_is_cycles_own(still_life: Callable[..., Any]) -> None:
    """In every mode: one render serves them all.

    To the bit on most processors; on some OIDN's runs differ in the last digits.
    """
    scene = still_life()
    ensure_registered()
    made, _ = call_engine(scene, lambda *given: sample_layer(*given, samples=2, seed=5))
    noisy = next(iter(made.values()))
    frame = Frame(
        number=0,
        camera=Camera(np.eye(4), np.eye(4), SIZE),
        radiance=noisy.radiance,
        albedo=noisy.albedo,
        normal=noisy.normal,
        depth=np.ones(SIZE[::-1], np.float32),
    )

    def render(passes: Any) -> dict[str, Any]:
        modes = CYCLES_DENOISING
        return {m: passes.beauty(1, 2, seed=5, denoiser=m).radiance for m in modes}

    for mode, expected in run_job(scene, render).items():
        ours = rivals.cycles_oidn(frame, mode)
        apart = np.abs(ours - expected).max()
        assert apart <= 1e-4 * expected.max(), (mode, apart)


def frames_of(colours: list[float], shift: int = 0) -> dict[int, Frame]:
    """Even frames with a brighter column; it moves by `shift` pixels a frame."""
    result = {}
    for number, colour in enumerate(colours):
        radiance = np.full((64, 64, 3), colour, np.float32)
        radiance[:, 32 + shift * (number - 1)] += 4.0
        vector = np.zeros((64, 64, 4), np.float32)
        vector[..., [0, 2]] = -shift
        result[number] = Frame(
            number=number,
            camera=Camera(np.eye(4), np.eye(4), (64, 64)),
            radiance=radiance,
            albedo=np.ones((64, 64, 3), np.float32),
            normal=np.zeros((64, 64, 3), np.float32),
            depth=np.ones((64, 64), np.float32),
            vector=vector,
        )
    return result


def test_the_median_leaves_out_what_one_frame_alone_shows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rivals, "cycles_oidn", lambda frame: frame.radiance)
    median = rivals.median_of_three(frames_of([1.0, 9.0, 2.0], shift=5), 1)
    inner = median[:, 8:-8]
    assert inner[:, :24] == pytest.approx(2.0)
    assert median[:, 32] == pytest.approx(6.0)  # moved onto its own place
    ends = rivals.median_of_three(frames_of([1.0, 9.0]), 1)
    assert ends[:, 0] == pytest.approx(9.0)


def test_non_local_means_follow_what_looks_alike() -> None:
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[:32, :40]
    frames = {}
    for number in range(3):
        true = np.where((columns - 2 * number) // 8 % 2 == rows // 8 % 2, 1.0, 0.2)
        halves = true[None, ..., None] + rng.normal(0, 0.1, (2, 32, 40, 3))
        frames[number] = replace(
            frames_of([1.0])[0],
            number=number,
            camera=Camera(np.eye(4), np.eye(4), (32, 40)),
            radiance=halves.mean(0).astype(np.float32),
            albedo=np.ones((32, 40, 3), np.float32),
            normal=np.zeros((32, 40, 3), np.float32),
            depth=np.ones((32, 40), np.float32),
            vector=None,
            halves=Halves(halves.astype(np.float32)),
        )
        if number == 1:
            middle = true[..., None]

    def error(picture: Array) -> float:
        return float(np.sqrt(np.mean((picture - middle) ** 2)))

    noisy, alone = frames[1].radiance, nl_means({1: frames[1]}, 1)
    assert noisy is not None
    assert error(alone) < 0.6 * error(noisy)  # edges stay: they would cost more
    assert error(nl_means(frames, 1)) < 0.8 * error(alone)


def test_films_show_the_largest_and_the_smallest_gain() -> None:
    points = [
        {"scene": s, "motion": "pan", "samples": 2, "method": m, "radius": r, "psnr": p}
        for s, psnr in (("a", 31.0), ("b", 34.0))
        for m, r, p in ((DEFAULT, 0, 30.0), (XRDS, 4, psnr))
    ]
    chosen = film.chosen(points, 2)
    assert chosen == {"best": ("b", "pan"), "worst": ("a", "pan")}
    assert film.chosen(points, 16) == {}
