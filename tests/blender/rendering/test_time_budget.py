"""Time budgets on scenes of a few pixels."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from channels import read_channels

pytest.importorskip("mitsuba_oidn")

from xrds_blender import render, run_job
from xrds_blender.command.render_file import render_file
from xrds_blender.interface.properties import request_of
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning import budget
from xrds_blender.planning.request import Machine, render_request
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.rendering import loading, time_budget
from xrds_blender.rendering.explain import explain
from xrds_core.errors import UsageError, XRDSError

FAST = Settings(Mode.FULL_SIZE, None, Denoising.XRDS_FAST).family
BEST = Settings(Mode.FULL_SIZE, None, Denoising.XRDS_BEST).family
FRAMES = [1, 2, 3]

# So dear that four samples are many: no test depends on how busy the machine is.
COSTS = budget.Costs(
    fixed=1.0,
    beauty=100.0,
    guide=50.0,
    denoise=dict.fromkeys(Denoising, 10.0),
    network={},
)


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Leave nothing but these denoisers, each as good as it is told."""

    def leave(**psnr: float) -> None:
        families = {"fast": FAST, "best": BEST}
        curves = {
            families[name]: budget.Curve((1, 16), (best - 4, best))
            for name, best in psnr.items()
        }
        model = replace(budget.shipped(), errors=budget.ErrorModel(curves))
        monkeypatch.setattr(budget, "shipped", lambda: model)
        monkeypatch.setattr(time_budget, "measure", lambda *_: COSTS)

    return leave


def test_tries_measure_the_scene(still_life: Callable[..., Any]) -> None:
    start = time.perf_counter()

    def measure(passes: Any) -> budget.Costs:
        return time_budget.measure(passes, budget.shipped(), start, Machine())

    costs = run_job(still_life(400, 300), measure)
    assert min(costs.fixed, costs.beauty, *costs.denoise.values()) > 0
    assert costs.fixed < time.perf_counter() - start + 1
    assert set(costs.denoise) == set(Denoising)


def test_a_sample_is_never_for_nothing() -> None:
    class Passes:
        """Of a frame so small that its size makes no difference."""

        def beauty(self, *_: Any, **__: Any) -> Any:
            return SimpleNamespace(seconds={"beauty": 0.02})

    assert time_budget._sample_seconds(Passes(), 4) > 0.0


def test_plan_tells_what_was_chosen_and_why(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(fast=40.0)
    picture = render(still_life(160, 96), time_budget=500.0)
    decision = picture.plan[0]
    assert decision.decision == "time budget"
    assert decision.value == "4 samples, fast"
    assert "dB expected in" in decision.reason
    assert picture.settings.samples == 4
    assert picture.settings.denoising is Denoising.XRDS_FAST
    assert picture.seconds["denoise"] > 0.0


def test_too_little_time_takes_one_sample(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(fast=40.0)
    picture = render(still_life(160, 96), time_budget=0.001)
    assert picture.settings.samples == 1
    assert "too short for this scene" in picture.plan[0].reason


@pytest.mark.parametrize(
    ("seconds_of_best", "quality"), [(400.0, "best"), (600.0, "fast")]
)
def test_time_that_the_samples_leave_is_for_a_better_denoiser(
    still_life: Callable[..., Any],
    only: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    seconds_of_best: float,
    quality: str,
) -> None:
    only(fast=40.0, best=41.0)
    costs = replace(
        COSTS, denoise=COSTS.denoise | {Denoising.XRDS_BEST: seconds_of_best}
    )
    monkeypatch.setattr(time_budget, "measure", lambda *_: costs)
    picture = render(still_life(64, 48), time_budget=500.0)
    # Four samples were foreseen to take 400 s; in truth there is all the time.
    assert picture.plan[0].value == "4 samples, fast"
    assert (picture.settings.samples, picture.settings.quality) == (4, quality)
    told = [each.value for each in picture.plan if each.decision == "denoise in time"]
    assert told == [quality] * (quality == "best")


def test_what_is_late_by_intent_keeps_its_denoiser(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(fast=40.0, best=41.0)
    picture = render(still_life(64, 48), time_budget=0.001)
    # As dear as the quickest by what is foreseen, and late whatever is taken.
    assert picture.settings.quality == "best"
    assert "denoise in time" not in [each.decision for each in picture.plan]


def test_without_our_denoiser_there_is_one_line(
    still_life: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: Any) -> None:
        raise XRDSError("Open Image Denoise is missing")

    monkeypatch.setattr(loading, "load_denoiser", missing)
    monkeypatch.setattr(time_budget, "load_denoiser", missing)
    with pytest.raises(XRDSError, match="Open Image Denoise is missing"):
        render(still_life(64, 48), time_budget=5.0)


def test_the_plan_told_is_the_one_rendered(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(fast=40.0)
    ensure_registered()
    scene = still_life(64, 48)
    told = explain(scene, render_request(time_budget=500.0))
    picture = render(scene, time_budget=500.0)
    before = [(each["decision"], each["value"]) for each in told["decisions"]]
    decided = [(each.decision, each.value) for each in picture.plan]
    assert before == decided[: len(before)]
    assert before[0][0] == "time budget"
    # What is left is what only a render can know.
    rest = {decision for decision, _ in decided[len(before) :]}
    assert rest <= {"guide prefilter", "denoise in time"}


def test_the_scene_is_as_before(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(fast=40.0)
    scene = still_life(64, 48, 7)
    render(scene, time_budget=300.0)
    assert (scene.cycles.samples, scene.cycles.use_denoising) == (7, False)


def test_panel_setting_reaches_the_job(still_life: Callable[..., Any]) -> None:
    scene = still_life()
    ensure_registered()
    scene.xrds.time_budget = 12.5
    assert request_of(scene.xrds).time_budget is None
    scene.xrds.use_time_budget = True
    assert request_of(scene.xrds).time_budget == 12.5
    scene.xrds.mode = "x2"  # chosen by hand: a budget is for full size
    request = request_of(scene.xrds)
    assert (request.time_budget, request.settings.mode) == (None, Mode.X2)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"time_budget": 0.0}, "must be above 0"), ({"denoiser": "BEST"}, "HIGH-ACC")],
)
def test_wrong_wishes_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        render_request(**wrong)


# --- A shot: its frames share their budgets -------------------------------------------


def rendered(blend: Path, radius: int = 1, **more: Any) -> dict[str, Any]:
    job = render_request(temporal_radius=radius, time_budget=2.0, **more)
    frames = str(blend.parent / "command" / "#.exr")
    return render_file(blend, frames, job, frames=FRAMES)


def test_the_budgets_of_a_shot_are_its_deadline(blend: Path) -> None:
    started = time.perf_counter()
    result = rendered(blend)
    assert time.perf_counter() - started < 30.0  # six, and the file's opening
    reused = [frame["temporal"]["frames"] for frame in result["frames"]]
    assert reused == [(1, 2), (1, 2, 3), (2, 3)]
    assert "deadline" in [each["decision"] for each in result["plan"]]


def test_an_animation_in_blender_has_the_same_deadline(blend: Path) -> None:
    ensure_registered()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.render.engine = "XRDS"
    scene.frame_start, scene.frame_end = 1, 3
    settings = scene.xrds
    settings.mode, settings.temporal_radius = "automatic", 1
    settings.use_time_budget, settings.time_budget = True, 2.0
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(blend.parent / "f12" / "#.exr")
    bpy.ops.render.render(animation=True)
    for number in FRAMES:
        channels = read_channels(blend.parent / "f12" / f"{number}.exr")
        assert np.isfinite(channels["R"]).all()
        assert channels["R"].any()


def test_the_plan_of_a_shot_tells_its_deadline(blend: Path) -> None:
    ensure_registered()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    job = render_request(temporal_radius=1, time_budget=20.0)
    told = explain(bpy.context.scene, job, FRAMES)
    assert told["seconds"] == 20.0
    values = {each["decision"]: each["value"] for each in told["decisions"]}
    assert "60 s for 3 frames" in values["deadline"]


def test_each_frame_has_its_own_budget_where_none_is_reused(
    blend: Path, only: Callable[..., None]
) -> None:
    only(fast=40.0)
    result = rendered(blend, radius=0)
    assert result["frames"][1]["temporal"] is None
    assert "time budget" in [each["decision"] for each in result["plan"]]
