"""Shots with the picture of the file's own settings, from fewer samples."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command import main
from xrds_blender.command.render_file import render_file
from xrds_blender.cycles import settings
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import sampling
from xrds_blender.rendering.full_size import FullSize
from xrds_blender.rendering.pace import measuring, more, obstacles, same_picture
from xrds_blender.rendering.pace.more import measured_regions, pixels_of
from xrds_blender.rendering.sampling import Sampled
from xrds_core.accumulation.frame import Frame, Stored
from xrds_core.pace.history import History
from xrds_core.pace.savings import Savings
from xrds_core.pace.worth import FALL, Errors
from xrds_core.shot import Shot

pytestmark = pytest.mark.skipif(
    not has_subsets(bpy.context.scene), reason="Cycles has no sample subsets"
)
FRAMES = [1, 2, 3, 4, 5, 6, 7]
SAMPLES = 16
LONG = Shot(tuple(range(1, 49)), 4, cuts=frozenset({31}))
MEASURED = [1, 4]  # the first frame, and the first beyond its neighbours


@pytest.fixture
def shot(blend: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene with enough samples to save some, in a short shot."""
    monkeypatch.setattr(obstacles, "FEWEST_FRAMES", len(FRAMES))
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = SAMPLES, False
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    bpy.ops.wm.save_mainfile()
    return blend


def render(
    blend: Path, out: str, frames: Sequence[int] = FRAMES, **job: Any
) -> list[dict[str, Any]]:
    request = {"scale": 1, "temporal_radius": 2, "same_picture": True} | job
    pattern = str(blend.parent / out / "#.exr")
    result = render_file(blend, pattern, render_request(**request), frames=frames)
    return result["frames"]


def picture(path: Path) -> np.ndarray:
    channels = read_channels(path)
    return np.dstack([channels[name] for name in "RGB"])


def errors_of(ratio: float) -> Errors:
    """The error of fewer samples is this, over that of all; by themselves as usual."""
    return Errors(np.array([ratio]), np.array([1.0]), np.array([0.25**-FALL]))


def measured(monkeypatch: pytest.MonkeyPatch, ratio: float) -> list[tuple[int, int]]:
    """Let the error of fewer samples be this, over that of all.

    Returns the counts that are rendered beside frames' own, and those of a sequence.
    """
    errors = errors_of(ratio)
    monkeypatch.setattr(measuring, "measure_errors", lambda *_: errors)
    lengths: list[tuple[int, int]] = []
    inner = more.more_samples

    def noted(engine: Any, depsgraph: Any, parts: Any, **more: Any) -> Any:
        if parts[0].whole > 1:  # one sample alone is timed
            lengths.append((sum(part.length for part in parts), parts[0].whole))
        return inner(engine, depsgraph, parts, **more)

    monkeypatch.setattr(more, "more_samples", noted)
    return lengths


def measured_in(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The frames that will have been measured in."""
    found: list[int] = []
    inner = same_picture.measure

    def noted(method: Any, own: Sampled, *more: Any) -> Any:
        found.append(own.number)
        return inner(method, own, *more)

    monkeypatch.setattr(same_picture, "measure", noted)
    return found


def test_fewer_samples_are_taken_where_they_are_enough(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured(monkeypatch, 0.5)
    shares = [frame["share"] for frame in render(shot, "same")]
    rest = [share for n, share in zip(FRAMES, shares, strict=True) if n not in MEASURED]
    assert min(rest) < 0.5, shares
    assert np.mean(rest) < 0.7, shares
    monkeypatch.undo()
    assert {frame["share"] for frame in render(shot, "time", same_picture=False)} == {1}


def test_all_samples_are_taken_where_neighbours_are_of_no_use(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lengths = measured(monkeypatch, 100.0)
    frames = render(shot, "same")
    # the second was sampled when the first had shown that all are needed
    shares = [{1: 2.25, 4: 3.0}.get(number, 1.0) for number in FRAMES]
    assert [frame["share"] for frame in frames] == pytest.approx(shares)
    # two of all in the first frame, and where neighbours lie on both sides; then the
    # rest of those sampled before it was done
    whole = SAMPLES, SAMPLES
    assert lengths[:2] == [whole, whole]
    assert lengths.count(whole) == 4
    # of sequences as long as that of the frame sampled last, which has all: for another
    # length Cycles would sync the scene again
    assert {*lengths} == {whole, (SAMPLES - SAMPLES // 4, SAMPLES)}


def test_one_frame_that_needs_more_does_not_raise_those_of_the_rest() -> None:
    pace = same_picture.SamePicture(SAMPLES, shot=LONG)
    errors = errors_of(0.8)
    pace._worth.add(errors, share=0.375, gain=4.0, neighbours=8)
    shares = []
    for gain in (4.0, 4.0, 4.0, 4.0, 3.2, 4.0, 4.0, 4.0, 4.0):
        pace._choose_next(gain)
        shares.append(pace.share)
    assert len({*shares}) == 1, shares
    assert 0.25 < shares[-1] < 0.5
    needed = 1.0 / pace._equal(1.0, 4.0)
    assert 0.0 <= shares[-1] - needed < 1.0 / SAMPLES  # the next number of samples
    for _ in range(4):
        pace._choose_next(2.0)
    assert pace.share > 1.2 * shares[-1]
    for _ in range(4):
        pace._choose_next(1.2)
    assert pace.share == 1.0  # where nearly all are needed


def test_frames_with_fewer_neighbours_take_more_at_once() -> None:
    pace = same_picture.SamePicture(SAMPLES, shot=LONG, share=0.25)
    assert pace._share_for(1) == 0.25  # nothing is known yet
    pace._worth.add(errors_of(0.8), share=0.25, gain=6.0, neighbours=8)
    pace._choose_next(6.0)
    usual = pace.share
    shares = [pace._share_for(number) for number in LONG.frames]
    assert shares[4:26] == [usual] * 22
    for end in (shares[26:30], shares[44:48]):  # before the cut, and at the end
        assert usual <= end[0] <= end[1] <= end[2] <= end[3], shares
        assert usual < end[3] < 1.0
    assert shares[30:34] == shares[29:25:-1]  # after the cut as before it
    lent = pace._equal(usual, 6.0) - usual  # by neighbours with the share of others
    for missing, share in enumerate(shares[44:48], start=1):
        equal = share + (8 - missing) / 8 * lent
        assert equal >= 1.0, shares
        assert share == usual or equal < 1.0 + 1.0 / SAMPLES, shares
    pace.history = History()  # frames before the window count as well
    assert {pace._share_for(number) for number in LONG.frames} == {usual}


def test_all_samples_are_taken_where_fewer_are_hardly_sooner(
    shot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lengths = measured(monkeypatch, 0.5)
    monkeypatch.setattr(Savings, "are_known", True)
    monkeypatch.setattr(Savings, "are_enough", False)
    shares = [frame["share"] for frame in render(shot, "same")]
    # decided in frame 1, when frames 2 and 3 had been sampled
    assert shares[3:] == [1.0] * 4
    assert lengths == [(SAMPLES, SAMPLES)] * 2  # measured once
    said = capsys.readouterr().err
    assert said.count("fewer samples are hardly sooner") == 1


def test_it_is_measured_anew_after_a_cut(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    scene = bpy.context.scene
    scene.timeline_markers.new("one", frame=1).camera = scene.camera
    other = scene.camera.copy()
    scene.collection.objects.link(other)
    scene.timeline_markers.new("two", frame=4).camera = other
    bpy.ops.wm.save_mainfile()
    measured(monkeypatch, 0.5)
    found = measured_in(monkeypatch)
    render(shot, "same")
    assert found == [1, 4]


def test_the_last_frames_show_nothing_new(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They gain less, for they have more samples of their own and fewer neighbours."""
    frames = [*range(1, 18)]
    monkeypatch.setattr(Savings, "are_known", False)  # whatever the clock says
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    for obj in bpy.data.objects:  # no frame is unlike another
        obj.animation_data_clear()
    camera = bpy.context.scene.camera
    for number in (1, 40):
        camera.location.x += 0.01
        camera.keyframe_insert("location", frame=number)
    bpy.context.scene.frame_end = frames[-1]
    bpy.ops.wm.save_mainfile()
    measured(monkeypatch, 0.5)
    found = measured_in(monkeypatch)
    made = render(shot, "same", frames, temporal_radius=4)
    assert made[-1]["share"] > made[8]["share"]
    assert found == [1, 6]


def test_a_frame_that_shows_something_new_is_told_by_what_neighbours_add() -> None:
    pace = same_picture.SamePicture(SAMPLES, shot=LONG)
    pace._gains.extend([6.0] * 4)
    own, beside = Sampled(30, {}, {}), [28, 29, 31, 32]

    assert not pace._is_new(own, beside, 2.0)  # too soon after the first
    for _ in range(20):
        pace._worth.is_due(8)
    assert pace._is_new(own, beside, 2.0)
    assert not pace._is_new(own, beside, 5.0)
    assert pace._is_new(own, [31, 32], 5.0)  # after a cut
    assert not pace._is_new(own, [], 1.0)


def test_more_samples_make_the_picture_of_all(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no neighbour is used, it is one render of all samples, but for noise."""
    measured(monkeypatch, 100.0)
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    for obj in bpy.data.objects:
        obj.animation_data_clear()
    scene = bpy.context.scene
    for number in FRAMES:  # another camera each: nothing is reused
        data = bpy.data.cameras.new(str(number))
        camera = bpy.data.objects.new(str(number), data)
        camera.matrix_world = scene.camera.matrix_world
        camera.keyframe_insert("location", frame=1)  # else frames share a sequence
        scene.collection.objects.link(camera)
        scene.timeline_markers.new(str(number), frame=number).camera = camera
    bpy.ops.wm.save_mainfile()
    render(shot, "same")
    render(shot, "time", same_picture=False)
    for number in set(FRAMES) - set(MEASURED):  # which have more than all
        pair = [
            picture(shot.parent / out / f"{number}.exr") for out in ("same", "time")
        ]
        assert np.allclose(*pair, rtol=0.02, atol=2e-3)


def test_a_noise_threshold_is_kept_and_raised(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    cycles = bpy.context.scene.cycles
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, 0.2
    cycles.samples = 64
    bpy.ops.wm.save_mainfile()
    sampled: list[float] = []
    is_even: list[bool] = []
    store = sampling.store

    def noted(frame: Frame, *more: Any) -> Stored:
        sampled.append(frame.samples)
        is_even.append(frame.counts is None)
        return store(frame, *more)

    monkeypatch.setattr(sampling, "store", noted)
    render(shot, "time", same_picture=False)
    all_of_them = sampled[2]  # the mean of the middle frame's pixels
    assert not any(is_even)
    sampled.clear()
    is_even.clear()
    measured(monkeypatch, 0.5)
    asked: list[int] = []
    set_sampling = settings.set_sampling

    def keep(borrowed: Any, scene: Any, samples: int, seed: int) -> None:
        asked.append(samples)
        set_sampling(borrowed, scene, samples, seed)

    monkeypatch.setattr(settings, "set_sampling", keep)
    render(shot, "same")
    assert sampled[2] < 0.6 * all_of_them
    # Until a frame was measured in, those of the file are not known; from then on
    # Cycles would look at a pixel's noise too seldom.
    assert not any(is_even[:3])
    assert all(is_even[3:])
    # Cycles lets the first of many samples stop later: only what is measured by is as
    # the file has it
    assert asked.count(64) == 2 * len(MEASURED)
    assert max(asked) == 64
    scene = bpy.context.scene
    assert scene.cycles.adaptive_threshold == pytest.approx(0.2)


def test_what_is_told_is_what_a_frame_has() -> None:
    pace = same_picture.SamePicture(64)
    assert pace._decision(0.25).value == "25% of the file's samples"
    # under a noise threshold the pixels decide: of what the file takes on the mean
    pace = same_picture.SamePicture(4096, has_threshold=True)
    pace._asked = 54.0
    frame = SimpleNamespace(samples=27.0)
    share = pace._share(Sampled(1, {"": frame}, {}), asked=0.25)
    assert pace._decision(share).value == "50% of the file's samples"


@pytest.mark.parametrize(
    ("samples", "share", "expected"),
    [
        (None, 0.25, False),  # not known yet
        (54.0, 0.25, True),
        (54.0, 1.0, True),  # two halves under a threshold would have 64
        (70.0, 1.0, False),  # the file's own way
        (300.0, 0.15, True),
        (300.0, 0.25, False),  # enough for Cycles to find where noise is
    ],
)
def test_few_samples_under_a_threshold_are_even(
    samples: float | None, share: float, expected: bool
) -> None:
    pace = same_picture.SamePicture(4096, has_threshold=True)
    pace._asked = samples
    assert pace._is_few(share) is expected


def test_what_was_not_measured_says_nothing_of_a_threshold() -> None:
    pace = same_picture.SamePicture(4096, has_threshold=True)
    asked = np.zeros((64, 192), np.float32)
    asked[:, :64] = 96.0
    frame = SimpleNamespace(samples=24.0, shape=asked.shape)
    found = measuring.Measured(errors_of(0.5), [], 0.1, asked)
    pace._learn(Sampled(1, {"": frame}, {}), found, 4.0, 8)
    assert pace._asked == 96.0
    assert pace._shares[1] == 0.25


@pytest.mark.parametrize("what", ["--samples 4", "--scale 2", "--sample-cache c"])
def test_what_rules_it_out_is_said(
    what: str, shot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["render", str(shot), "-o", str(shot.parent / "#.exr"), "--same-picture"]
    words += ["--frames", "1-7", *what.split()]
    assert main.main(words) == 2
    assert "--same-picture cannot be had with" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("job", "frames"),
    [({"samples": 16}, 7), ({"temporal_radius": 0}, 7), ({}, 6), ({"scale": 2}, 7)],
)
def test_elsewhere_frames_have_the_samples_of_the_file(
    job: dict[str, Any], frames: int, shot: Path
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    request = {"scale": 1, "temporal_radius": 2, "same_picture": True} | job
    scene = bpy.context.scene
    assert not obstacles.can_save(scene, render_request(**request), frames)
    possible = render_request(1, temporal_radius=2, same_picture=True)
    assert obstacles.can_save(scene, possible, len(FRAMES))
    scene.view_layers[0].samples = 32  # a layer's own
    assert not obstacles.can_save(scene, possible, len(FRAMES))


def test_the_engine_renders_what_the_command_does(shot: Path) -> None:
    render(shot, "command", temporal_radius=4)
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    scene = bpy.context.scene
    scene.render.engine, scene.xrds.mode = "XRDS", "full_size"
    assert scene.xrds.animation == "same_picture"
    scene.render.filepath = str(shot.parent / "engine" / "#")
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.render.render(animation=True)
    for number in FRAMES:
        pair = [
            picture(shot.parent / out / f"{number}.exr")
            for out in ("command", "engine")
        ]
        assert np.allclose(*pair, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize(("frames", "is_said"), [("1-7", True), ("1-6", False)])
def test_the_plan_of_a_shot_says_so(
    frames: str, is_said: bool, shot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["plan", str(shot), "--scale", "1", "--same-picture", "--frames", frames]
    assert main.main(words) == 0
    assert ("same picture: as few samples" in capsys.readouterr().out) == is_said


@pytest.mark.parametrize(
    ("shape", "share"),
    [
        ((1080, 1920), 0.07),
        ((2160, 3840), 0.07),
        ((540, 960), 0.13),
        ((256, 384), 0.5),
        ((200, 250), 0.51),
        ((96, 128), 1.0),
    ],
)
def test_large_pictures_are_measured_in_parts_from_top_to_bottom(
    shape: tuple[int, int], share: float
) -> None:
    together = np.zeros(shape, int)
    for turn in range(4):
        covered = np.zeros(shape, int)
        for region in measured_regions(shape, turn):
            assert region.height == shape[0]
            covered[pixels_of(region)] += 1
        assert covered.max() == 1
        assert covered.mean() == pytest.approx(share, abs=0.04)
        assert np.array_equal(covered, covered[:, ::-1])
        together += covered
    # one after the other at other places, the middle among them
    assert together[:, shape[1] // 2].all()
    assert (together > 0).mean() >= min(0.9, 3.7 * share)


def test_what_is_measured_is_the_picture(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it, without the parts of its light; or a strip of it."""
    inner, differences = measuring.measure, []

    def noted(method: Any, own: Any, others: Any, *more: Any) -> Any:
        (view,) = own.views
        shown = np.asarray(method.finish(own, others, view).radiance)
        height, width = shown.shape[:2]
        for columns in (slice(0, width), slice(0, width // 2)):
            part = method.radiance(own, others, view, (slice(0, height), columns))
            assert part.shape == (height, columns.stop, 3)
            differences.append(np.abs(part - shown[:, columns]).mean() / shown.mean())
        return inner(method, own, others, *more)

    monkeypatch.setattr(same_picture, "measure", noted)
    render(shot, "same")
    assert len(differences) == 2 * len(MEASURED)
    assert max(differences[::2]) == 0.0
    assert 0.0 < max(differences[1::2]) < 0.05  # the denoiser sees less


def test_the_other_eye_is_a_neighbour_where_it_is_measured(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    bpy.context.scene.render.use_multiview = True
    bpy.ops.wm.save_mainfile()
    measured(monkeypatch, 0.5)
    inner, lent = FullSize.accumulate, []

    def noted(self: Any, own: Sampled, others: Any, view: str) -> Any:
        found = inner(self, own, others, view)
        if not others:
            lent.append(float(found.samples.mean()) - own.views[view].samples)
        return found

    monkeypatch.setattr(FullSize, "accumulate", noted)
    render(shot, "same")
    assert lent == [0.0] * len(MEASURED)


def test_a_part_is_measured_and_all_of_the_frame_gets_what_it_lacks(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    render_settings = bpy.context.scene.render
    render_settings.resolution_x, render_settings.resolution_y = 288, 96
    bpy.ops.wm.save_mainfile()
    monkeypatch.setattr("xrds_blender.rendering.pace.more._LEAST_AREA", 2000)
    assert len(measured_regions((96, 288))) == 2
    sizes: list[int] = []

    def noted(ours: Any, alone: Any, noisy: Any, parts: Any, *_: Any) -> Errors:
        sizes.append(ours.shape[0] * ours.shape[1])
        assert ours.shape == alone.shape == noisy.shape == parts[0].noisy.shape
        return errors_of(100.0)

    lent: dict[int, float] = {}
    inner = same_picture.SamePicture._lent

    def noted_lent(self: Any, share: float, others: Any) -> float:
        lent.update(self._shares)
        return inner(self, share, others)

    monkeypatch.setattr(measuring, "measure_errors", noted)
    monkeypatch.setattr(same_picture.SamePicture, "_lent", noted_lent)
    frames = render(shot, "same")
    assert sizes == [2 * 64 * 96] * 2
    shares = {number: x["share"] for number, x in zip(FRAMES, frames, strict=True)}
    # all samples everywhere, and those that it was measured by
    part = 2 * 64 / 288
    expected = {1: 1.0 + 2.0 * part, 4: 1.0 + 2.0 * part}
    for number in FRAMES:
        assert shares[number] == pytest.approx(expected.get(number, 1.0)), shares
    # what it is measured by is lent as well: others seemed to gain by their neighbours
    # what they gain by these few alone
    assert lent[1] == pytest.approx(0.25 + 2.0 * part)
    assert lent[4] == pytest.approx(1.0 + 2.0 * part)
