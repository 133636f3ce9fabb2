"""Shots: frames that lend their samples to their neighbours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender import run_job
from xrds_blender.command import main
from xrds_blender.command.render_file import render_file
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.internals.lifetimes import RENDER_JOB
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import full_size, shot
from xrds_blender.rendering import render as engine_shots
from xrds_blender.rendering.blender_job import call_engine
from xrds_blender.rendering.sampling import noisy_frame
from xrds_core import exr, finish
from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.camera import SKY_DEPTH

FRAMES = [1, 2, 3, 4, 5]


def picture(path: Path) -> np.ndarray:
    channels = read_channels(path)
    return np.dstack([channels[name] for name in "RGB"])


def render(blend: Path, out: str, **more: Any) -> dict[str, Any]:
    job = {"scale": 1, "temporal_radius": 2} | more.pop("job", {})
    pattern = str(blend.parent / out / "#.exr")
    return render_file(
        blend, pattern, render_request(**job), **{"frames": FRAMES, **more}
    )


def truth(blend: Path) -> np.ndarray:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.frame_set(3)
    return run_job(scene, lambda p: p.beauty(1, 256, denoise=False, seed=9)).radiance


def test_neighbours_make_a_better_picture(blend: Path) -> None:
    render(blend, "alone", job={"temporal_radius": 0})
    result = render(blend, "shot")
    reference = truth(blend)
    alone, shared = (
        np.square(picture(blend.parent / name / "3.exr") - reference).mean()
        for name in ("alone", "shot")
    )
    assert shared < 0.8 * alone
    temporal = [frame["temporal"] for frame in result["frames"]]
    assert [t["frames"] for t in temporal] == [
        (1, 2, 3),
        (1, 2, 3, 4),
        (1, 2, 3, 4, 5),
        (2, 3, 4, 5),
        (3, 4, 5),
    ]
    assert 2.0 < temporal[2]["mean_samples"] <= 5.0
    assert all(0.0 <= t["rejected"] < 0.5 for t in temporal)
    assert all(frame["seconds"]["accumulate"] > 0.0 for frame in result["frames"])


@pytest.mark.skipif(
    not has_subsets(bpy.context.scene), reason="Cycles has no sample subsets"
)
@pytest.mark.parametrize(("offset", "length", "taken"), [(4, 2, 2), (6, 4, 2)])
def test_a_sample_subset_of_the_file(
    blend: Path, offset: int, length: int, taken: int
) -> None:
    """Cycles writes no depth with an offset; the frames are reused all the same."""
    cycles = bpy.context.scene.cycles
    cycles.samples, cycles.use_adaptive_sampling = 8, False
    cycles.use_sample_subset = True
    cycles.sample_offset, cycles.sample_subset_length = offset, length
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    for frame in render(blend, "shot", frames=[1, 2, 3])["frames"]:
        assert frame["samples"] == taken
        assert frame["temporal"]["rejected"] < 0.75  # all of it without depth
        assert taken < frame["temporal"]["mean_samples"] <= 3 * taken
    file = exr.File(blend.parent / "shot" / "1.exr")
    assert file.parts[0].attributes["xrds.samples"] == str(taken)


@pytest.mark.skipif(
    not has_subsets(bpy.context.scene), reason="Cycles has no sample subsets"
)
def test_depth_of_a_sample_subset_lies_along_the_axis(blend: Path) -> None:
    """What Cycles writes there is a length along the ray."""
    scene, made = bpy.context.scene, []
    cycles, job = scene.cycles, render_request(scale=1, temporal_radius=1)
    cycles.samples, cycles.use_adaptive_sampling = 8, False
    for cycles.use_sample_subset in (False, True):
        cycles.sample_offset, cycles.sample_subset_length = 4, 2
        frames, _ = call_engine(scene, lambda *given: noisy_frame(*given, job))
        made.append(frames[""])
    first, late = (frame.depth for frame in made)
    axis = made[0].camera.depth_per_length(first.shape)
    corners = (axis < np.quantile(axis, 0.2)) & (first < SKY_DEPTH)
    assert abs(np.median((late / first)[corners]) - 1.0) < 0.03


def test_every_frame_is_sampled_once(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered = []

    def count(scene: Any, work: Any) -> Any:
        rendered.append(scene.frame_current)
        return call_engine(scene, work)

    monkeypatch.setattr(shot, "call_engine", count)
    render(blend, "shot")
    assert rendered == FRAMES


def test_frames_that_are_there_only_lend(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    render(blend, "shot")
    folder = blend.parent / "shot"
    whole = picture(folder / "5.exr")
    (folder / "5.exr").unlink()
    rendered = []

    def count(scene: Any, work: Any) -> Any:
        rendered.append(scene.frame_current)
        return call_engine(scene, work)

    monkeypatch.setattr(shot, "call_engine", count)
    result = render(blend, "shot", resume=True)
    assert result["kept"] == [1, 2, 3, 4]
    assert rendered == [3, 4, 5]
    # the files differ: each tells its seconds
    assert np.array_equal(picture(folder / "5.exr"), whole)


def test_no_two_frames_have_the_same_noise(blend: Path) -> None:
    """Whatever the file's seed says: a still camera would gain nothing."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.camera.animation_data_clear()
    scene.cycles.use_animated_seed = False
    job = render_request(scale=1, temporal_radius=1)
    pictures = [p for _, p in shot.render_shot(scene, job, [1, 2])]
    assert pictures[0].temporal.mean_samples == pytest.approx(2.0, abs=0.05)
    method = engine_shots.method_of(job)
    first, second = (
        call_engine(scene, method.sample).views[""].picture[:, :3].astype(np.float32)
        for _ in map(scene.frame_set, (1, 2))
    )
    assert np.abs(first - second).mean() > 1e-4


def test_under_a_still_camera_frames_continue_one_sequence(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their mean is one render with all the samples, not one of many seeds."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    if not has_subsets(scene):
        pytest.skip("this Blender continues no sequence")
    scene.camera.animation_data_clear()
    scene.cycles.use_adaptive_sampling = False
    accumulated = []

    def keep(own: Any, others: Any, *more: Any, **how: Any) -> Any:
        found = accumulate(own, others, *more, **how)
        accumulated.extend([found] if others else [])
        return found

    monkeypatch.setattr(finish, "accumulate", keep)
    job = render_request(scale=1, temporal_radius=2, seed=4)
    assert len(list(shot.render_shot(scene, job, FRAMES))) == 5
    whole = run_job(scene, lambda p: p.beauty(1, 5, denoise=False, seed=4))
    middle = accumulated[2]
    assert middle.samples.mean() > 3.8  # one sample without halves is doubted at edges
    difference = np.abs(middle.radiance - whole.radiance)
    assert np.median(difference) < 1e-3  # half floats
    own = np.abs(accumulated[0].radiance - whole.radiance)  # three frames of five
    assert np.median(own) > 3 * np.median(difference)


def test_a_cancelled_shot_keeps_the_frames_before(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from xrds_core.errors import Cancelled

    def cancel_at_four(scene: Any, work: Any) -> Any:
        if scene.frame_current == 4:
            raise Cancelled
        return call_engine(scene, work)

    monkeypatch.setattr(shot, "call_engine", cancel_at_four)
    with pytest.raises(Cancelled):
        render(blend, "shot")
    assert [p.name for p in sorted((blend.parent / "shot").iterdir())] == ["1.exr"]


@pytest.mark.parametrize(
    ("line", "radius"),
    [
        ("--frames 1-3", 4),
        ("-a", 4),
        ("--frames 1-3 --temporal-radius 2", 2),
        ("--frames 1-3 --temporal-radius 0", 0),
        ("--frame 1", 0),
        ("--scale 2 --frames 1-3", 4),
        ("--plain --frames 1-3", 0),
        ("--time-budget 9 --frames 1-3", 4),
    ],
)
def test_the_radius_by_default(line: str, radius: int) -> None:
    from xrds_blender.command.options import request_of

    words = ["render", "a.blend", "-o", "b_#.exr", *line.split()]
    found = request_of(main._parser(words).parse_args(words))
    assert found.settings.temporal_radius == radius
    assert found.settings.scale == (2 if "--scale 2" in line else 1)


def test_a_radius_that_cannot_be_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    words = "render a.blend -o b_#.exr --plain --frames 1-3 --temporal-radius 1"
    assert main.main(words.split()) == 2
    assert "--temporal-radius cannot be had with --plain" in capfd.readouterr().err


# --- Blender's own animation renders --------------------------------------------------


@pytest.fixture
def animation(blend: Path) -> Any:
    """The shot, set up for the engine to write multilayer files."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.render.engine = "XRDS"
    scene.xrds.mode, scene.xrds.temporal_radius = "full_size", 2
    scene.frame_start, scene.frame_end = 1, 5
    scene.view_layers[0].use_pass_normal = True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(blend.parent / "f12" / "#.exr")
    return scene


def layers(path: Path) -> dict[str, np.ndarray]:
    return read_channels(path)


def combined(path: Path) -> np.ndarray:
    found = layers(path)
    names = [next(n for n in found if n.endswith(f"Combined.{c}")) for c in "RGB"]
    return np.dstack([found[name] for name in names])


def test_an_animation_is_the_shot_of_the_command(animation: Any, blend: Path) -> None:
    bpy.ops.render.render(animation=True)
    render(blend, "command")
    for number in FRAMES:
        ours = combined(blend.parent / "f12" / f"{number}.exr")
        theirs = picture(blend.parent / "command" / f"{number}.exr")
        np.testing.assert_allclose(ours, theirs, atol=2e-3)


@pytest.mark.parametrize(
    "stage", ["Samples of frame 1", "Samples of frame 3", "Denoising"]
)
def test_a_stopped_frame_shows_itself(
    animation: Any, blend: Path, stopped_in: Callable[[str], None], stage: str
) -> None:
    """Denoised, whatever frame ahead was being sampled.

    Blender itself knows nothing of the stop here, so it saves what it would show.
    """
    for frame in (1, 3):
        animation.camera.location.x = 0.4 * frame
        animation.camera.keyframe_insert("location", frame=frame)
    animation.frame_end = 3
    stopped_in(stage)
    path = blend.parent / "f12" / "1.exr"
    true = {}
    for number in (1, 3):
        animation.frame_set(number)
        true[number] = run_job(animation, lambda p: p.beauty(1, 64, denoise=False))
    noisy = run_job(animation, lambda p: p.beauty(1, 1, denoise=False)).radiance

    def error(number: int) -> float:
        return float(np.abs(combined(path) - true[number].radiance).mean())

    assert error(1) < 0.5 * error(3)
    assert error(1) < 0.6 * np.abs(noisy - true[3].radiance).mean()
    (name,) = [n for n in layers(path) if n.endswith("Normal.X")]
    normals = run_job(animation, lambda p: p.guides(16)).normal  # of frame 3
    animation.frame_set(1)
    own = run_job(animation, lambda p: p.guides(16)).normal
    there = layers(path)[name]
    assert (
        np.abs(there - own[..., 0]).mean()
        < 0.5 * np.abs(there - normals[..., 0]).mean()
    )


def test_passes_are_those_of_the_frame(animation: Any, blend: Path) -> None:
    bpy.ops.render.render(animation=True)
    animation.render.engine = "CYCLES"
    animation.cycles.seed = 3
    for number in (1, 4):
        animation.frame_set(number)
        animation.render.filepath = str(blend.parent / f"own{number}.exr")
        bpy.ops.render.render(write_still=True)
        own = layers(blend.parent / f"own{number}.exr")
        ours = layers(blend.parent / "f12" / f"{number}.exr")
        for channel in "XYZ":
            (name,) = [n for n in own if n.endswith(f"Normal.{channel}")]
            assert np.abs(own[name] - ours[name]).mean() < 0.05


def test_frames_in_steps_lend_in_steps(animation: Any, blend: Path) -> None:
    seen = []
    finish = full_size.finish_frame

    def look(own: Any, lenders: Any, *rest: Any, **more: Any) -> Any:
        seen.append(sorted([own.number, *(each.number for each in lenders)]))
        return finish(own, lenders, *rest, **more)

    animation.frame_step = 2
    full_size.finish_frame = look
    try:
        bpy.ops.render.render(animation=True)
    finally:
        full_size.finish_frame = finish
    assert seen == [[1, 3, 5]] * 3
    assert not RENDER_JOB.of(engine_shots.Animations).by_layer


def test_a_still_has_no_neighbours(animation: Any, blend: Path) -> None:
    animation.frame_set(3)
    animation.render.filepath = str(blend.parent / "still.exr")
    bpy.ops.render.render(write_still=True)
    render(blend, "alone", job={"temporal_radius": 0}, frames=[3])
    ours = combined(blend.parent / "still.exr")
    np.testing.assert_allclose(
        ours, picture(blend.parent / "alone" / "3.exr"), atol=2e-3
    )


def test_frames_by_number_are_rendered_by_themselves(
    animation: Any, blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `blender -b FILE -f 1..5` does: each is a render job of its own there."""
    monkeypatch.setattr("sys.argv", ["blender", "-b", "shot.blend", "-f", "1..5"])
    monkeypatch.setattr(engine_shots, "_is_program_without_window", lambda: True)
    rendered = []
    monkeypatch.setattr(
        "xrds_blender.rendering.sampling.noisy_frame", lambda *_: rendered.append(1)
    )
    animation.frame_end = 2
    bpy.ops.render.render(animation=True)
    assert not rendered
    assert len(list((blend.parent / "f12").iterdir())) == 2


def test_scripts_see_frames_ahead_as_they_see_their_own(animation: Any) -> None:
    """Light that a script sets just before a frame is rendered, by its number."""
    background = animation.world.node_tree.nodes["Background"].inputs["Strength"]
    seen = []

    def dim(scene: Any) -> None:
        seen.append(scene.frame_current)
        background.default_value = 0.2 + 0.3 * scene.frame_current

    def fail(scene: Any, _: Any) -> None:
        raise ValueError(f"frame {scene.frame_current}")

    bpy.app.handlers.render_pre.extend([dim, fail])
    try:
        bpy.ops.render.render(animation=True)
        assert sorted(set(seen)) == FRAMES
        job = render_request(scale=1, temporal_radius=2)
        pictures = [p.radiance for _, p in shot.render_shot(animation, job, FRAMES)]
    finally:
        bpy.app.handlers.render_pre.remove(dim)
        bpy.app.handlers.render_pre.remove(fail)
    folder = Path(animation.render.filepath).parent
    assert pictures[4].mean() > 1.5 * pictures[0].mean()
    for number, expected in zip(FRAMES, pictures, strict=True):
        found = combined(folder / f"{number}.exr")
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("words", "alone"),
    [
        ("blender -b shot.blend -f 3", True),
        ("blender -b shot.blend --render-frame 3 -- -a", True),
        ("blender -b shot.blend -a -- -f out", False),
        ("blender -b shot.blend -f 3 -a", False),
    ],
)
def test_what_stands_after_two_dashes_decides_nothing(
    words: str, alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", words.split())
    assert not engine_shots._renders_single_frames()  # a script with the module
    monkeypatch.setattr(engine_shots, "_is_program_without_window", lambda: True)
    assert engine_shots._renders_single_frames() == alone


def panorama(kind: str) -> Any:
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    held = camera if hasattr(camera, "panorama_type") else camera.cycles
    held.panorama_type = kind
    return held


def test_equirectangular_frames_lend_by_direction(blend: Path) -> None:
    """Also under a camera that turns: places, normals and the frame's edges agree."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    held = panorama("EQUIRECTANGULAR")
    held.longitude_min, held.longitude_max, held.latitude_max = -1.2, 1.0, 0.2
    for frame in (1, 5):
        scene.camera.rotation_euler.z = 0.05 * frame
        scene.camera.keyframe_insert("rotation_euler", frame=frame)
    job = render_request(scale=1, samples=16, temporal_radius=1)
    method = engine_shots.method_of(job)
    here, there = (
        call_engine(scene, method.sample).views[""]
        for _ in map(scene.frame_set, (1, 4))
    )
    alone, both = accumulate(here, []), accumulate(here, [there])
    assert both.rejected < 0.45
    hit = np.abs(alone.normal).sum(-1) > 0.5
    lent = hit & (both.samples > 20.0)
    assert lent.sum() > 0.2 * hit.sum()
    apart = np.abs(both.normal - alone.normal)[lent]
    assert np.median(apart) < 0.001


def test_other_panoramas_are_rendered_frame_by_frame(blend: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    panorama("FISHEYE_EQUISOLID")
    bpy.ops.wm.save_mainfile()
    result = render(blend, "pano", frames=[1, 2])
    assert [frame["temporal"] for frame in result["frames"]] == [None, None]


# --- Cuts ----------------------------------------------------------------------------


def with_second_camera(scene: Any) -> None:
    """The same view again from frame 3 on, by a camera of another name."""
    second = scene.camera.copy()
    scene.collection.objects.link(second)
    for frame, camera in ((1, scene.camera), (3, second)):
        scene.timeline_markers.new("cut", frame=frame).camera = camera


def test_across_a_cut_nothing_is_lent(blend: Path) -> None:
    with_second_camera(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    result = render(blend, "whole")
    lent = [frame["temporal"]["frames"] for frame in result["frames"]]
    assert lent == [(1, 2), (1, 2), (3, 4, 5), (3, 4, 5), (3, 4, 5)]
    render(blend, "after", frames=[3, 4, 5])
    for number in (3, 4, 5):
        whole, after = (blend.parent / n / f"{number}.exr" for n in ("whole", "after"))
        assert np.array_equal(picture(whole), picture(after))


def test_an_animation_knows_its_cuts(animation: Any, blend: Path) -> None:
    with_second_camera(animation)
    bpy.ops.render.render(animation=True)
    animation.frame_start = 3
    animation.render.filepath = str(blend.parent / "after" / "#.exr")
    bpy.ops.render.render(animation=True)
    for number in (3, 4, 5):
        whole, after = (blend.parent / n / f"{number}.exr" for n in ("f12", "after"))
        assert np.array_equal(combined(whole), combined(after))


# --- A camera that stands still ------------------------------------------------------


def moves_by_keys() -> None:
    cube = bpy.data.objects["Red"]
    for frame in (1, 5):
        cube.location.x = -1.0 - 0.2 * frame
        cube.keyframe_insert("location", frame=frame)


def moves_by_a_script() -> None:
    """Nothing in the file tells that it moves."""

    def place(scene: Any, *_: Any) -> None:
        bpy.data.objects["Red"].location.x = -1.0 - 0.2 * scene.frame_current

    bpy.app.handlers.frame_change_pre.append(place)


@pytest.mark.parametrize("move", [lambda: None, moves_by_keys, moves_by_a_script])
def test_continued_frames_keep_passes_of_one_sample(
    animation: Any, blend: Path, move: Callable[[], None]
) -> None:
    """Depth is the frame's own though most frames begin late in their sequence."""
    animation.camera.animation_data_clear()
    animation.cycles.use_adaptive_sampling = False
    animation.view_layers[0].use_pass_z = True
    move()
    bpy.ops.render.render(animation=True)
    animation.render.engine = "CYCLES"
    for number in (1, 2, 5):
        animation.frame_set(number)
        animation.render.filepath = str(blend.parent / f"own{number}.exr")
        bpy.ops.render.render(write_still=True)
        ours, own = (
            next(p for n, p in layers(blend.parent / path).items() if ".Depth.Z" in n)
            for path in (f"f12/{number}.exr", f"own{number}.exr")
        )
        np.testing.assert_allclose(ours, own, rtol=1e-3)


def test_an_animation_continues_the_sequence_of_the_command(
    animation: Any, blend: Path
) -> None:
    animation.camera.animation_data_clear()
    animation.view_layers[0].use_pass_z = False
    lamp = bpy.data.lights["Lamp"]
    for frame in (1, 5):
        lamp.energy = 100 + 20 * frame
        lamp.keyframe_insert("energy", frame=frame)
    bpy.ops.wm.save_mainfile()
    bpy.ops.render.render(animation=True)
    render(blend, "command")
    for number in FRAMES:
        ours = combined(blend.parent / "f12" / f"{number}.exr")
        theirs = picture(blend.parent / "command" / f"{number}.exr")
        np.testing.assert_allclose(ours, theirs, atol=2e-3)


def test_views_of_a_pair_lend_to_each_other(
    animation: Any, blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They see the same floor from two places, each with its own camera."""
    accumulated = []

    def keep(own: Any, lenders: Any, *more: Any, **how: Any) -> Any:
        found = accumulate(own, lenders, *more, **how)
        accumulated.extend([(own, list(lenders), found)] if lenders else [])
        return found

    monkeypatch.setattr(finish, "accumulate", keep)
    animation.render.use_multiview = True
    animation.render.views_format = "STEREO_3D"
    animation.camera.data.stereo.interocular_distance = 0.3
    animation.frame_set(3)
    list(shot.render_shot(animation, render_request(scale=1, temporal_radius=1), [3]))
    own, (other,), found = accumulated[0]
    assert own.number == other.number == 3
    apart = np.linalg.inv(other.camera.view) - np.linalg.inv(own.camera.view)
    assert np.linalg.norm(apart[:3, 3]) == pytest.approx(0.3, rel=1e-3)
    assert 1.6 < found.samples.mean() <= 2.0
