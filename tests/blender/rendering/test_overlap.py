"""Frames finished while the next ones are sampled: the same pictures, sooner."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from channels import read_channels

from xrds_blender.cycles.session import samples_on_card
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import render as renders
from xrds_blender.rendering import shot as shots
from xrds_blender.rendering.full_size import FullSize
from xrds_blender.rendering.pace import obstacles
from xrds_blender.rendering.pace.same_picture import SamePicture

FRAMES = range(1, 6)


def test_without_a_card_nothing_overlaps(life: Any) -> None:
    life.cycles.device = "CPU"
    assert not samples_on_card(life)
    life.cycles.device = "GPU"  # but no card is chosen in the preferences
    assert not samples_on_card(life)


def test_a_shot_is_the_same_and_finished_while_the_next_is_sampled(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = render_request(scale=1, samples=2, temporal_radius=1)
    expected = dict(shots.render_shot(life, job, FRAMES))
    threads: list[str] = []
    finish = FullSize.finish

    def noted(*args: Any, **choices: Any) -> Any:
        threads.append(threading.current_thread().name)
        return finish(*args, **choices)

    monkeypatch.setattr(FullSize, "finish", noted)
    monkeypatch.setattr(shots, "samples_on_card", lambda _: True)
    found = dict(shots.render_shot(life, job, FRAMES))
    assert list(found) == list(FRAMES)
    for number, picture in found.items():
        np.testing.assert_array_equal(picture.radiance, expected[number].radiance)
    assert len(threads) == len(FRAMES)
    assert all(name.startswith("finish") for name in threads)


@pytest.mark.skipif(
    not has_subsets(bpy.context.scene), reason="Cycles has no sample subsets"
)
def test_a_frame_is_judged_while_the_next_is_sampled(
    life: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One frame late, in a shot as in the engine's own animation."""
    life.cycles.samples, life.cycles.use_adaptive_sampling = 8, False
    numbers = range(1, 10)
    monkeypatch.setattr(obstacles, "FEWEST_FRAMES", len(numbers))
    events: list[str] = []
    inner = {x: getattr(FullSize, x) for x in ("sample", "prepare", "complete")}

    def noted(name: str, number: int, worked_on: str) -> None:
        assert threading.current_thread().name.startswith(worked_on)
        events.append(f"{name} {number}")

    def sample(self: Any, engine: Any, depsgraph: Any, *more: Any, **how: Any) -> Any:
        noted("sample", depsgraph.scene_eval.frame_current, "Main")
        return inner["sample"](self, engine, depsgraph, *more, **how)

    def prepare(self: Any, own: Any, others: Any) -> Any:
        noted("prepare", own.number, "finish" if own.number > first else "")
        return inner["prepare"](self, own, others)

    def complete(self: Any, own: Any, *more: Any) -> Any:
        noted("complete", own.number, "Main")
        return inner["complete"](self, own, *more)

    for method in (sample, prepare, complete):
        monkeypatch.setattr(FullSize, method.__name__, method)
    for module in (shots, renders):
        monkeypatch.setattr(module, "samples_on_card", lambda _: True)
    first = 0
    job = render_request(scale=1, temporal_radius=1, same_picture=True)
    pictures = dict(shots.render_shot(life, job, numbers))
    assert list(pictures) == list(numbers)
    orders = [list(events)]
    events.clear()
    first = 1  # there is nothing to judge the engine's first frame beside
    life.render.engine = "XRDS"
    life.xrds.mode, life.xrds.temporal_radius = "full_size", 1
    life.xrds.animation = "same_picture"
    life.frame_start, life.frame_end = numbers[0], numbers[-1]
    life.render.filepath = str(tmp_path / "#.exr")
    life.render.image_settings.file_format = "OPEN_EXR"
    bpy.ops.render.render(animation=True)
    orders.append(events)
    for order in orders:
        for name in ("sample", "prepare", "complete"):
            done = [x for x in order if x.startswith(name)]
            assert done == [f"{name} {n}" for n in numbers]
        for number in range(2, 8):
            judged, made = (
                order.index(f"{x} {number}") for x in ("prepare", "complete")
            )
            last, later = (order.index(f"sample {number + x}") for x in (1, 2))
            assert last < judged < made
            assert later < made


@pytest.mark.parametrize("ahead", [2, 3])
def test_an_animation_of_the_engine_is_the_same(
    life: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ahead: int
) -> None:
    """Pictures and passes, with frames sampled while the one before is finished.

    One further `ahead` where it is judged how many samples a frame needs.
    """
    if ahead == 3:
        if not has_subsets(life):
            pytest.skip("Cycles has no sample subsets")
        life.cycles.samples, life.cycles.use_adaptive_sampling = 8, False
        monkeypatch.setattr(obstacles, "FEWEST_FRAMES", len(FRAMES))
        # a later frame hears of it a frame later: here all have the same share
        monkeypatch.setattr(SamePicture, "_choose_next", lambda *_: None)
        life.xrds.animation = "same_picture"
    life.render.engine = "XRDS"
    life.xrds.mode, life.xrds.temporal_radius = "full_size", 1
    life.frame_start, life.frame_end = 1, 5
    life.view_layers[0].use_pass_normal = life.view_layers[0].use_pass_z = True
    for number in (1, 5):
        life.camera.location.x = 0.2 * number
        life.camera.keyframe_insert("location", frame=number)
    settings = life.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    began: list[tuple[str, str]] = []
    finish, sample = FullSize.finish, FullSize.sample

    def noted(self: Any, own: Any, *more: Any, **choices: Any) -> Any:
        began.append((f"finish {own.number}", threading.current_thread().name))
        return finish(self, own, *more, **choices)

    def sampled(self: Any, engine: Any, depsgraph: Any, *more: Any, **how: Any) -> Any:
        number = depsgraph.scene_eval.frame_current
        began.append((f"sample {number}", threading.current_thread().name))
        return sample(self, engine, depsgraph, *more, **how)

    monkeypatch.setattr(FullSize, "finish", noted)
    monkeypatch.setattr(FullSize, "sample", sampled)
    orders = []
    for folder, is_on in (("turn", False), ("beside", True)):
        monkeypatch.setattr(renders, "samples_on_card", lambda _, on=is_on: on)
        life.render.filepath = str(tmp_path / folder / "#.exr")
        began.clear()
        bpy.ops.render.render(animation=True)
        orders.append([name for name, _ in began])
        threads = {thread for name, thread in began if name.startswith("finish")}
        assert all(thread.startswith("finish") == is_on for thread in threads)
    for number in FRAMES:
        pair = [
            read_channels(tmp_path / x / f"{number}.exr") for x in ("turn", "beside")
        ]
        assert pair[0].keys() == pair[1].keys()
        for name, channel in pair[0].items():
            np.testing.assert_array_equal(channel, pair[1][name], err_msg=name)
    # each frame is sampled once, and a frame earlier
    for order in orders:
        assert sorted(x for x in order if x.startswith("sample")) == [
            f"sample {n}" for n in FRAMES
        ]
    # "finish 1" is put before "sample 3" begins, and "finish 2" comes after it
    turn, beside = orders
    assert turn.index("sample 3") > turn.index("finish 1")
    assert turn.index("sample 4") > turn.index("finish 2")
    assert beside.index(f"sample {ahead + 2}") < beside.index("finish 3")
    assert len(beside) == len(turn) == 2 * len(FRAMES)
