"""The Cycles renders inside one engine call: what they hold and what they leave."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender import run_job
from xrds_blender.cycles import session  # bpy is asked for first
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.internals.borrowed import Borrowed, PipelineSettings
from xrds_blender.rendering.blender_job import call_engine
from xrds_core.errors import Cancelled, SceneError

Build = Callable[..., Any]


def test_scale_one_is_cycles_bit_for_bit(still_life: Build, written: Any) -> None:
    scene = still_life(41, 30)
    plain = written(scene, "CYCLES")[..., :3]

    def job(passes: Any) -> Any:
        passes.beauty(2, 1)
        passes.guides(1)
        return passes.beauty(1, denoise=False).radiance

    np.testing.assert_array_equal(run_job(scene, job), plain)


def test_a_frame_in_tiles_is_denoised_after_its_last_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As Cycles 4.5 tells it; only what comes before the first sample is sync."""
    now = 0.0
    monkeypatch.setattr(session.time, "perf_counter", lambda: now)
    lines = (
        "house, ViewLayer | Updating Scene BVH",
        "house, ViewLayer | Sample 0/1",
        "house, ViewLayer | Rendered 3/4 Tiles, Sample 1/1",
        "house, ViewLayer | Finished",
        "house | Reading full buffer from disk",
        "house | ViewLayer | Denoising",
        "house | ViewLayer | Finishing",
    )
    with session.StageClock() as heard:
        for line in lines:
            now += 1.0
            heard._hear(f"Fra:1 Mem:45.07M (Peak 319.10M) | {line}")
        now += 1.0
    assert heard.sync == 2.0
    assert heard.render == 6.0


def animate(scene: Any) -> None:
    """Motion blur with a moving cube and camera and a changing lens."""
    cube, camera = bpy.data.objects["Red"], scene.camera
    for frame, height, lens in ((1, 1.0, 50), (3, 2.0, 70)):
        cube.location.z, camera.location.x, camera.data.lens = height, height, lens
        cube.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("location", frame=frame)
        camera.data.keyframe_insert("lens", frame=frame)
    scene.render.use_motion_blur = True
    scene.frame_set(2)


@pytest.mark.parametrize("moving", [False, True])
def test_one_session_renders_what_a_session_each_would(
    still_life: Build, moving: bool
) -> None:
    """Size, filter, samples and bounces are new in each pass, and nothing is stale."""
    scene = still_life()
    if moving:
        animate(scene)

    def job(passes: Any, fresh: bool) -> list[np.ndarray]:
        pictures = []
        for call in (
            lambda: passes.beauty(2, 4, denoise=False, seed=1).radiance,
            lambda: passes.guides(4, seed=2).albedo,
            lambda: passes.beauty(1, 4, denoise=False, seed=3).radiance,
            lambda: passes.low_samples(1, 4, seed=4)[""].samples.picture,
            lambda: passes.beauty(4, 8, denoise=False, seed=5).radiance,
        ):
            if fresh:
                session.free(passes._engine)
            pictures.append(call())
        return pictures

    kept = run_job(scene, lambda passes: job(passes, fresh=False))
    fresh = run_job(scene, lambda passes: job(passes, fresh=True))
    for one, other in zip(kept, fresh, strict=True):
        np.testing.assert_array_equal(one, other)
    assert kept[0].shape == (18, 24, 3)
    assert kept[2].shape == (36, 48, 3)


@pytest.mark.parametrize("kind", ["beauty", "samples"])
def test_fewer_samples_keep_their_own_blue_noise(still_life: Build, kind: str) -> None:
    """Laid for more samples it would be worse to denoise, with nothing to see."""
    scene = still_life()

    def few(passes: Any) -> np.ndarray:
        if kind == "beauty":
            return passes.beauty(1, 2, denoise=False, seed=1).radiance
        return passes.low_samples(1, 2, seed=1)[""].samples.picture

    def after_many(passes: Any) -> np.ndarray:
        passes.beauty(4, 16, denoise=False)
        return few(passes)

    np.testing.assert_array_equal(run_job(scene, after_many), run_job(scene, few))


def test_the_low_picture_is_the_mean_of_the_full_one(still_life: Build) -> None:
    scene = still_life(40, 32)

    def job(passes: Any) -> Any:
        with Borrowed() as borrowed:
            cycles = passes._scene.cycles
            borrowed.set(cycles, pixel_filter_type="BOX", filter_width=1.0)
            full = passes.beauty(1, 64, denoise=False, seed=1)
        return full, passes.beauty(4, 256, denoise=False, seed=2)

    full, low = run_job(scene, job)
    means = full.radiance.reshape(8, 4, 10, 4, 3).mean((1, 3))
    error = np.abs(low.radiance - means).mean() / means.mean()
    assert error < 0.03


def test_guides_keep_albedo_and_normals_of_the_full_render(still_life: Build) -> None:
    """The shortcuts change nothing a network sees, not even in a mirror."""
    scene = still_life()

    def job(passes: Any) -> Any:
        return passes.guides(32, seed=1), passes.low_samples(1, 32, seed=2)

    short, full = run_job(scene, job)
    for name in ("albedo", "normal"):
        difference = np.abs(getattr(short, name) - getattr(full[""].samples, name))
        assert difference.mean() < 0.01, name
    np.testing.assert_array_equal(short.alpha, 1.0)
    assert short.depth.shape == (36, 48)


def test_denoising_gives_both_pictures(still_life: Build) -> None:
    if not session.has_denoiser():
        pytest.skip("this Blender has no OpenImageDenoise")
    scene = still_life()

    def job(passes: Any) -> Any:
        noisy = passes.beauty(2, 2, denoise=False, seed=1)
        return noisy, passes.beauty(2, 2, seed=1)

    noisy, clean = run_job(scene, job)
    assert noisy.noisy is None
    np.testing.assert_array_equal(clean.noisy, noisy.radiance)
    assert np.abs(clean.radiance - noisy.radiance).max() > 0.01
    roughness = [np.abs(np.diff(x.radiance, axis=0)).mean() for x in (clean, noisy)]
    assert roughness[0] < 0.9 * roughness[1]


def test_without_a_denoiser_the_picture_stays_noisy(
    still_life: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "has_denoiser", lambda: False)
    scene = still_life()

    def job(passes: Any) -> Any:
        noisy = passes.beauty(2, 2, denoise=False, seed=1)
        return noisy, passes.beauty(2, 2, denoise=True, seed=1)

    noisy, asked = run_job(scene, job)
    assert asked.noisy is None
    np.testing.assert_array_equal(asked.radiance, noisy.radiance)


@pytest.mark.parametrize("crop", [False, True])
def test_a_border_holds_the_pixels_of_the_whole(still_life: Build, crop: bool) -> None:
    scene = still_life(45, 33)

    def job(passes: Any) -> Any:
        scales = (1, 2, 4)
        beauties = [passes.beauty(s, 64, denoise=False, seed=1) for s in scales]
        return passes.region, beauties, passes.guides(16, seed=1)

    _, whole, guides = run_job(scene, job)
    render = scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = 0.31, 0.8
    render.border_min_y, render.border_max_y = 0.2, 0.93
    region, parts, part_guides = run_job(scene, job)
    rows = slice(region.y, region.y + region.height)
    columns = slice(region.x, region.x + region.width)
    assert (region.x, region.y) == (13, 3)  # int(0.31 * 45), 33 - int(0.93 * 33)
    difference = part_guides.albedo - guides.albedo[rows, columns]
    assert np.abs(difference).mean() < 0.02
    for scale, all_, part in zip((1, 2, 4), whole, parts, strict=True):
        dy, dx = part.offset
        assert (dy, dx) == (region.y % scale, region.x % scale)
        y, x = (region.y - dy) // scale, (region.x - dx) // scale
        height, width = part.radiance.shape[:2]
        assert height == -(-(region.height + dy) // scale)
        difference = part.radiance - all_.radiance[y : y + height, x : x + width]
        assert np.abs(difference).mean() < 0.05, scale


def test_tiles_change_no_pixel(still_life: Build) -> None:
    """Larger pictures go through a file of tiles; the low one may need none."""
    scene = still_life(150, 100, samples=1)

    def job(passes: Any) -> list[np.ndarray]:
        low = passes.beauty(4, denoise=False, seed=1).radiance
        return [low, passes.guides(1, seed=1).normal]

    whole = run_job(scene, job)
    scene.cycles.use_auto_tile, scene.cycles.tile_size = True, 64
    for tiled, one in zip(run_job(scene, job), whole, strict=True):
        np.testing.assert_array_equal(tiled, one)


def test_stereo_renders_both_views(still_life: Build) -> None:
    scene = still_life(45, 33, samples=4)
    scene.render.use_multiview = True
    scene.camera.data.stereo.interocular_distance = 0.5

    def job(passes: Any) -> Any:
        beauties = passes.beauties(2, denoise=False, seed=1)
        return passes.views, beauties, passes.guides_by_view(4, seed=1)

    views, beauties, guides = run_job(scene, job)
    assert views == ["left", "right"]
    for by_view in (beauties, guides):
        left, right = (by_view[view] for view in views)
        kind = "radiance" if by_view is beauties else "normal"
        assert np.abs(getattr(left, kind) - getattr(right, kind)).mean() > 0.01


def test_what_a_job_raises_reaches_the_caller(still_life: Build) -> None:
    def job(passes: Any) -> None:
        passes.beauty(2, 1)
        raise ZeroDivisionError("on purpose")

    with pytest.raises(ZeroDivisionError, match="on purpose"):
        run_job(still_life(), job)
    assert run_job(bpy.context.scene, lambda passes: passes.width) == 48


@pytest.mark.parametrize("call", ["beauty", "guides"])
def test_a_cancelled_pass_raises(
    still_life: Build, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    monkeypatch.setattr(session, "is_stopped", lambda engine: True)
    with pytest.raises(Cancelled):
        run_job(
            still_life(),
            lambda passes: passes.guides(1) if call == "guides" else passes.beauty(2),
        )


def test_no_camera_is_one_clear_line(still_life: Build) -> None:
    scene = still_life()
    scene.camera = None
    with pytest.raises(SceneError, match="'Scene' has no camera; add one") as error:
        run_job(scene, lambda passes: None)
    assert "\n" not in str(error.value)


def test_an_unknown_layer_is_named(still_life: Build) -> None:
    with pytest.raises(SceneError, match="no view layer 'Nowhere'; it has ViewLayer"):
        run_job(still_life(), lambda passes: None, layer="Nowhere")


def test_an_unknown_blender_is_refused(
    still_life: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bytes at the wrong place are noticed before anything is written to them."""
    scene = still_life()
    run_job(scene, lambda passes: passes.width)
    places = dict(PipelineSettings._places)
    places["resolution_x"] = (places["resolution_y"][0] + 4, 0)
    monkeypatch.setattr(PipelineSettings, "_places", places)
    with pytest.raises(SceneError, match="in a way that XRDS does not know"):
        run_job(scene, lambda passes: passes.width)


def test_seconds_of_every_stage_are_told(still_life: Build) -> None:
    def job(passes: Any) -> Any:
        return passes.beauty(2, 8, denoise=False).seconds, passes.guides(1).seconds

    for seconds in run_job(still_life(96, 72), job):
        stage = (seconds.keys() & {"beauty", "guides"}).pop()
        assert seconds["sync"] > 0
        assert seconds[stage] > 0


@pytest.mark.parametrize(("counts", "sessions"), [((2, 2, 8), 1), ((8, 2, 8), 2)])
def test_a_session_ends_only_when_samples_fall(
    still_life: Build,
    monkeypatch: pytest.MonkeyPatch,
    counts: tuple[int, ...],
    sessions: int,
) -> None:
    cycles, created = session.functions(), []
    create = cycles.create

    def counting(*arguments: Any, **options: Any) -> None:
        created.append(1)
        create(*arguments, **options)

    monkeypatch.setattr(cycles, "create", counting)

    def job(passes: Any) -> None:
        for count in counts:
            passes.beauty(4, count, denoise=False)
            passes.guides(1)

    run_job(still_life(), job)
    assert len(created) == sessions


def test_settings_return_where_a_render_evaluates_anew(still_life: Build) -> None:
    """As for vectors beside a cut: the structs set are not there any more then."""
    ensure_registered()
    scene = still_life()
    other = scene.camera.copy()
    scene.collection.objects.link(other)
    for frame, camera in ((1, scene.camera), (2, other)):
        scene.timeline_markers.new("cut", frame=frame).camera = camera
    samples = scene.cycles.samples

    def work(engine: Any, depsgraph: Any) -> int:
        evaluated = depsgraph.scene_eval
        with Borrowed() as borrowed:
            borrowed.set(evaluated.cycles, samples=77)
            borrowed.set(depsgraph.view_layer_eval.cycles, use_denoising=False)
            engine.frame_set(2, 0.0)
            engine.frame_set(1, 0.0)
            evaluated.cycles.samples = 55
        return int(evaluated.cycles.samples)

    assert call_engine(scene, work) == samples
