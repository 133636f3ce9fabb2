"""Shots that end at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from frame_sources import Frames

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command import main
from xrds_blender.command.render_file import render_file
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import sampling
from xrds_blender.rendering.pace import deadline as deadline_module
from xrds_blender.rendering.pace.deadline import Deadline
from xrds_blender.rendering.sampling import Sampled
from xrds_core.errors import UsageError
from xrds_core.frame_source import Window
from xrds_core.shot import Shot

RADIUS = 2


@dataclass
class Farm:
    """Renders frames in seconds of its own: no clock is waited for.

    A frame takes `sync`, `start` and `sample` for each of its samples, the latter two
    times its `cost`, and `finish` beside that.
    """

    monkeypatch: pytest.MonkeyPatch
    start: float = 0.4
    sync: float = 1.0
    sample: float = 0.25
    finish_seconds: float = 3.0
    now: float = 100.0
    counts: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        clock = SimpleNamespace(perf_counter=lambda: self.now)
        self.monkeypatch.setattr(deadline_module, "time", clock)

    def finish(self, *_: Any) -> Any:
        self.now += self.finish_seconds
        return SimpleNamespace(seconds={"denoise": self.finish_seconds})

    def render(
        self, limit: float, cost: Any = lambda _: 1.0, frames: int = 40
    ) -> float:
        """Return the seconds that a shot took; `counts` are the samples of frames."""
        began = self.now
        for _ in self.frames(Deadline(limit, frames, frames, _began=began), cost):
            pass
        return self.now - began

    def frames(
        self, pace: Deadline, cost: Any = lambda _: 1.0, count: int | None = None
    ) -> Iterator[int]:
        """Render the frames of one view layer, and yield after each."""
        frames = count or pace.to_finish
        request = render_request(1, temporal_radius=RADIUS)

        def load(number: int) -> Sampled:
            while True:
                samples = pace.request(request, 1).settings.own_samples
                took = (self.start + samples * self.sample) * cost(number)
                sync = self.sync if number else 0.0
                self.now += took + sync
                views: dict[str, Any] = {"": None}
                seconds = {"beauty": took, "sync": sync}
                frame = Sampled(number, views, seconds, samples=samples)
                if pace.takes(self, frame):
                    self.counts.append(samples)
                    return frame

        for found in Window(Shot(tuple(range(frames)), RADIUS), Frames(load)):
            frame = pace.complete(self, found.own, (), lambda _: ({}, {}), None)
            assert frame.decisions[0].decision == "deadline"
            self.finish()
            yield found.number


@pytest.mark.parametrize("seconds", [300.0, 1000.0, 20000.0])
def test_a_shot_ends_within_five_percent_and_looks_even(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    farm = Farm(monkeypatch)
    assert farm.render(seconds) == pytest.approx(seconds, rel=0.05)
    even = np.asarray(farm.counts[:-4])
    assert even.std() <= 0.1 * even.mean() + 0.5, farm.counts


def test_layers_that_render_in_turn_share_the_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    farm, limit = Farm(monkeypatch), 2000.0
    began = farm.now
    pace = Deadline(limit, 80, 80, _began=began)
    layers = [farm.frames(pace, count=40) for _ in range(2)]
    for _ in zip(*layers, strict=True):
        pass
    assert farm.now - began == pytest.approx(limit, rel=0.05)
    counts = np.asarray(farm.counts[20:-10])
    assert counts.std() < 0.15 * counts.mean(), farm.counts


def test_frames_that_grow_dear_take_fewer_samples(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    farm = Farm(monkeypatch)
    took = farm.render(2000.0, cost=lambda number: 1.0 + number / 20)
    assert took == pytest.approx(2000.0, rel=0.05)
    assert farm.counts[-1] < farm.counts[0]


def test_frames_a_hundred_times_as_dear_are_late_by_one_of_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    farm = Farm(monkeypatch)
    farm.render(1000.0, cost=lambda number: 100.0 if number > 30 else 1.0)
    assert farm.counts[31] > 50  # nothing tells of it beforehand
    assert set(farm.counts[32:]) == {1}
    assert capsys.readouterr().err.count("less than one sample") == 1


def test_no_time_is_one_sample_a_frame_and_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    farm = Farm(monkeypatch)
    farm.render(1.0)
    assert set(farm.counts) == {1}
    said = capsys.readouterr().err
    assert said.count("less than one sample for a frame; with one, 40 frames") == 1
    assert "about 2 min" in said


def test_one_frame_takes_what_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    farm = Farm(monkeypatch)
    assert farm.render(60.0, frames=1) == pytest.approx(60.0, rel=0.05)


@pytest.mark.skipif(
    not has_subsets(bpy.context.scene), reason="Cycles has no sample subsets"
)
def test_the_command_and_the_engine_keep_it(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rendered: the samples fill the time, whatever the file's are."""
    numbers, seconds = list(range(1, 7)), 12.0
    farm = Farm(monkeypatch, start=0.05, sync=0.1, sample=0.02, finish_seconds=0.2)
    takes = Deadline.takes

    def on_the_farm(pace: Deadline, _: Any, frame: Sampled) -> bool:
        """A rendered frame, in the farm's seconds."""
        took = farm.start + farm.sample * (frame.samples or 0)
        farm.now += took + farm.sync
        told = {"beauty": took, "sync": farm.sync}
        return takes(pace, farm, replace(frame, seconds=told))  # type: ignore[arg-type]

    monkeypatch.setattr(Deadline, "takes", on_the_farm)
    began = farm.now
    request = render_request(1, temporal_radius=RADIUS, deadline=seconds)
    pattern = str(blend.parent / "command" / "#.exr")
    frames = render_file(blend, pattern, request, frames=numbers)["frames"]
    samples = [frame["samples"] for frame in frames]
    assert min(samples) > bpy.context.scene.cycles.samples, samples
    assert 0.7 * seconds < farm.now - began < 1.05 * seconds

    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    own = scene.cycles.samples
    scene.render.engine, scene.xrds.animation = "XRDS", "deadline"
    scene.xrds.deadline = seconds
    scene.frame_start, scene.frame_end = numbers[0], numbers[-1]
    scene.render.filepath = str(blend.parent / "engine" / "#")
    scene.render.image_settings.file_format = "OPEN_EXR"
    bpy.ops.render.render(animation=True)
    assert scene.cycles.samples == own
    assert len(list((blend.parent / "engine").iterdir())) == len(numbers)


@pytest.mark.parametrize(("frames", "radius"), [([1], RADIUS), ([1, 2], 0)])
def test_it_is_kept_without_neighbours(
    blend: Path, frames: list[int], radius: int
) -> None:
    request = render_request(1, temporal_radius=radius, deadline=1.0)
    done = render_file(blend, str(blend.parent / "#.exr"), request, frames=frames)
    assert [each["frame"] for each in done["frames"]] == frames


def test_it_is_kept_without_halves(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a Blender before 4.4: each try is one render of a shot's frame."""
    monkeypatch.setattr(sampling, "has_subsets", lambda _: False)
    request = render_request(1, temporal_radius=RADIUS, deadline=1.0)
    done = render_file(blend, str(blend.parent / "#.exr"), request, frames=[1, 2])
    assert [each["frame"] for each in done["frames"]] == [1, 2]


@pytest.mark.parametrize("what", ["--samples 4", "--scale 2", "--time-budget 3"])
def test_what_rules_it_out_is_said(
    what: str, blend: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["render", str(blend), "-o", str(blend.parent / "#.exr"), "--deadline"]
    words += ["8h", "--frames", "1-5", *what.split()]
    assert main.main(words) == 2
    assert "--deadline cannot be had with" in capsys.readouterr().err


def test_the_plan_of_a_shot_says_so(
    blend: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["plan", str(blend), "--deadline", "1h30m"]
    assert main.main([*words, "--frames", "1-5"]) == 0
    assert "deadline: 90 min for 5 frames: each takes" in capsys.readouterr().out


def test_a_deadline_must_be_ahead() -> None:
    with pytest.raises(UsageError, match=r"deadline 0\.0 s must be above 0"):
        render_request(1, deadline=0.0)
