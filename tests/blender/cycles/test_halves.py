"""Frames of a shot are sampled in two halves, whose mean is the usual frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.cycles.settings import has_subsets
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import sampling
from xrds_blender.rendering.blender_job import call_engine
from xrds_core.accumulation.frame import Frame


@pytest.fixture
def scene(blend: Path) -> Any:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    if not has_subsets(scene):
        pytest.skip("this Blender renders no part of a sequence")
    scene.cycles.use_adaptive_sampling = False
    return scene


def sampled(scene: Any, **job: Any) -> Frame:
    how = render_request(**{"scale": 1, "temporal_radius": 2, "seed": 3} | job)
    frames, _ = call_engine(scene, lambda *given: sampling.noisy_frame(*given, how))
    return next(iter(frames.values()))


@pytest.mark.parametrize("samples", [2, 5, 8])
def test_the_mean_of_both_halves_is_one_render(
    scene: Any, samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = sampled(scene, samples=samples)
    monkeypatch.setattr(sampling, "_has_halves", lambda *_: False)
    whole = sampled(scene, samples=samples)
    assert whole.halves is None
    assert frame.halves is not None
    for name in ("radiance", "albedo", "normal", "alpha"):
        found, expected = getattr(frame, name), getattr(whole, name)
        assert found == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert np.abs(np.diff(frame.halves.radiance, axis=0)).max() > 0
    assert np.array_equal(frame.depth, whole.depth)


def test_one_sample_has_no_halves(scene: Any) -> None:
    assert sampled(scene, samples=1).halves is None


@pytest.mark.parametrize("threshold", [0.05, 0.2, 0.0])
def test_a_noise_threshold_is_kept_and_its_samples_are_counted(
    scene: Any, threshold: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = scene.cycles
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, threshold
    cycles.samples = 128
    frame = sampled(scene)
    assert frame.counts is not None
    assert 1.0 <= frame.samples <= 128.0
    assert frame.halves is not None
    assert frame.halves.counts == pytest.approx(
        np.stack([frame.halves.counts[0], frame.counts - frame.halves.counts[0]])
    )
    share = (frame.halves.counts[0] / frame.counts)[..., None]
    mean = frame.halves.radiance[0] * share + frame.halves.radiance[1] * (1 - share)
    assert frame.radiance == pytest.approx(mean, rel=1e-5, abs=1e-6)
    assert frame.samples == pytest.approx(frame.counts.mean(), rel=1e-3)
    monkeypatch.setattr(sampling, "_has_halves", lambda *_: False)
    whole = sampled(scene)
    assert whole.halves is None
    # Cycles looks after every sixteenth sample of each half whether a pixel may stop
    assert 0.6 < frame.samples / whole.samples < 1.4
    assert cycles.adaptive_threshold == pytest.approx(threshold)
    assert cycles.samples == 128


@pytest.mark.parametrize("samples", [6, 33])
def test_where_no_pixel_can_stop_both_halves_are_one_render(
    scene: Any, samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = scene.cycles
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, 0.5
    cycles.adaptive_min_samples = 2
    cycles.samples = samples
    frame = sampled(scene)
    cycles.use_adaptive_sampling = False
    monkeypatch.setattr(sampling, "_has_halves", lambda *_: False)
    whole = sampled(scene)
    is_one = np.allclose(frame.radiance, whole.radiance, rtol=1e-3, atol=1e-4)
    assert is_one == (samples < 32)  # each half is looked at after 16


def test_halves_under_a_noise_threshold_take_about_what_one_render_does(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = scene.cycles
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, 0.005
    cycles.samples = 4096
    frame = sampled(scene)
    monkeypatch.setattr(sampling, "_has_halves", lambda *_: False)
    whole = sampled(scene)
    # one more look by Cycles, of 16 samples; halves of one sequence took 1.8 times it
    assert frame.samples < 1.2 * whole.samples


def test_with_a_time_limit_a_frame_has_no_halves(scene: Any) -> None:
    scene.cycles.time_limit, scene.cycles.samples = 10.0, 8
    assert sampled(scene).halves is None


def test_motion_under_blur_is_told_by_a_render_without(scene: Any) -> None:
    thing = next(x for x in scene.objects if x.type == "MESH")
    for number in (1, 5):
        thing.location.x += 0.2
        thing.keyframe_insert("location", frame=number)
    scene.render.use_motion_blur = True
    scene.frame_set(3)
    frame = sampled(scene, samples=2)
    assert frame.vector is not None
    assert np.abs(frame.vector).max() > 0.5
    assert frame.halves is not None
