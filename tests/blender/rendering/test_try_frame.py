"""A frame by Cycles and by XRDS in the same seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.cycles import session
from xrds_blender.planning.request import Request, render_request
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.rendering import history
from xrds_blender.rendering import try_frame as module
from xrds_blender.rendering.render import render
from xrds_blender.rendering.shot import render_shot
from xrds_blender.rendering.split import draw_split, line_width, split_picture
from xrds_blender.rendering.try_frame import FEWEST, try_frame, wanted_samples
from xrds_core.errors import Cancelled, SceneError


@pytest.fixture
def scene(blend: Any) -> Any:
    """Five frames under a camera that moves."""
    found = bpy.context.scene
    found.frame_start, found.frame_end = 1, 5
    found.frame_set(2)
    return found


def request(radius: int = 1) -> Request:
    return render_request(1, temporal_radius=radius)


def state(scene: Any) -> list[Any]:
    render, cycles = scene.render, scene.cycles
    return [
        *(scene.frame_current, scene.frame_subframe, scene.camera, render.engine),
        *(render.use_compositing, render.use_sequencer, render.use_persistent_data),
        *(cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling),
    ]


def test_both_ways_of_one_frame(scene: Any) -> None:
    before, lines = state(scene), []
    scene.cycles.samples = 4
    tried = try_frame(scene, request(), lines.append)
    assert state(scene) == [*before[:7], 4, *before[8:]]
    assert tried.frame == 2
    assert tried.frames == (1, 2, 3)
    for way in (tried.cycles, tried.xrds):
        assert way.pixels.shape == (48, 64, 4)
        assert way.pixels.dtype == np.float32
        assert way.seconds > way.finishing
    apart = np.abs(tried.cycles.pixels - tried.xrds.pixels).mean()
    assert 0.0 < apart < 0.1 * tried.cycles.pixels.mean()
    assert tried.cycles.samples == 4
    assert tried.xrds.samples >= FEWEST
    assert "Denoise is off" in tried.notes[0]
    assert lines[-1] == "frame 2: denoising"
    full = Settings(Mode.FULL_SIZE, 4, Denoising.XRDS_HIGH)
    assert history.seconds(scene, full, 1) > history.seconds(scene, full) > 0.0


def test_cycles_picture_is_cycles_own(scene: Any) -> None:
    """Of this frame, to the bit."""
    scene.cycles.use_denoising, scene.cycles.samples = True, 3
    for number in (1, 3):  # neighbours see it from far aside
        scene.camera.location.x = number
        scene.camera.keyframe_insert("location", frame=number)
    scene.frame_set(2)
    tried = try_frame(scene, request())
    own = render(scene, plain=True)
    np.testing.assert_array_equal(tried.cycles.pixels, own.pixels)
    assert tried.notes == tuple(x for x in tried.notes if "too short" in x)


@pytest.mark.parametrize("still", [False, True])
def test_our_picture_is_that_of_a_shot(scene: Any, still: bool) -> None:
    if still:  # frames then continue one sequence
        scene.camera.animation_data_clear()
        cube = bpy.data.objects["Red"]
        for number in (1, 5):
            cube.location.x = 0.1 * number
            cube.keyframe_insert("location", frame=number)
        scene.frame_set(2)
    tried = try_frame(scene, request())
    shot = request().with_settings(samples=tried.xrds.samples)
    pictures = dict(render_shot(scene, shot, [1, 2, 3]))
    np.testing.assert_array_equal(tried.xrds.pixels, pictures[2].pixels)


def test_no_frame_is_sampled_twice_where_the_time_is_short(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    sampled: list[tuple[int, int]] = []
    sample = module._Trial._sample

    def count(self: Any, samples: int, number: int, *more: Any) -> Any:
        sampled.append((number, samples))
        frame, _ = sample(self, samples, number, *more)
        return frame, 5.0

    def quick(self: Any) -> Any:
        return replace(cycles(self), seconds=1.0)

    cycles = module._Trial._render_by_cycles
    monkeypatch.setattr(module._Trial, "_sample", count)
    monkeypatch.setattr(module._Trial, "_render_by_cycles", quick)
    tried = try_frame(scene, request())
    # the first is to warm up
    assert sampled == [(1, FEWEST), (2, FEWEST), (1, FEWEST), (3, FEWEST)]
    assert tried.xrds.samples == FEWEST
    assert tried.xrds.seconds > 5.0
    assert "too short for 2 samples" in tried.notes[-1]


@pytest.mark.parametrize(
    ("seconds", "tried", "samples"),
    [
        (10.0, [(2, 1.0)], 20),
        (0.1, [(2, 1.0)], FEWEST),
        (11.0, [(2, 3.0), (8, 6.0)], 18),  # 2 s beside, 0.5 s each
        (5.0, [(2, 3.0), (8, 6.0)], 6),
        (100.0, [(2, 3.0), (8, 6.0)], 32),  # four times as many at once
        (12.0, [(2, 3.0), (4, 3.0)], 16),  # alike by chance
    ],
)
def test_samples_that_fit(
    seconds: float, tried: list[tuple[int, float]], samples: int
) -> None:
    assert wanted_samples(seconds, tried) == samples


def unmoved(scene: Any) -> None:
    scene.camera.animation_data_clear()


def without_camera(scene: Any) -> None:
    scene.camera = None


def eevee(scene: Any) -> None:
    new = bpy.app.version >= (4, 2) and bpy.app.version < (5,)
    scene.render.engine = "BLENDER_EEVEE_NEXT" if new else "BLENDER_EEVEE"


def far_off(scene: Any) -> None:
    scene.frame_set(60)


def one_frame(scene: Any) -> None:
    scene.frame_end = 1


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (without_camera, "has no camera"),
        (unmoved, "is no animation"),
        (one_frame, "is no animation"),
        (eevee, "choose Cycles or XRDS"),
        (far_off, "frame 60 has no neighbours among frames 1 to 5"),
    ],
)
def test_what_cannot_be_tried_is_said(
    scene: Any, change: Callable[[Any], None], line: str
) -> None:
    change(scene)
    with pytest.raises(SceneError, match=line):
        try_frame(scene, request())


def test_beside_the_range_neighbours_are_those_in_it(scene: Any) -> None:
    scene.frame_set(0)
    assert module._frames_of(scene, request(2)) == (0, 1, 2)


def test_a_stopped_try_leaves_the_scene_as_it_was(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, lines = state(scene), []
    monkeypatch.setattr(session, "is_stopped", lambda _: len(lines) > 1)
    with pytest.raises(Cancelled):
        try_frame(scene, request(), lines.append)
    assert state(scene) == before


def test_moving_the_line_is_drawing_it_anew() -> None:
    rng = np.random.default_rng(1)
    left, right = rng.random((2, 6, 40, 4)).astype(np.float32)
    mixed, before = split_picture(left, right), 20
    assert line_width(1920) == 2
    for place in (3, 31, 30, 39, 0, 17):
        draw_split(mixed, left, right, place, before)
        before, whole = place, np.empty_like(left)
        draw_split(whole, left, right, place)
        assert (mixed == whole).all()
        assert (mixed[:, :place] == left[:, :place]).all()
        assert (mixed[:, place + 1 :] == right[:, place + 1 :]).all()
