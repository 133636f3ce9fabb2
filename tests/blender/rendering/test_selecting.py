"""Time budgets on a scene of a few pixels, with the shipped weights."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from xrds_blender import render, run_job
from xrds_blender.cycles import session
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning import budget
from xrds_blender.planning.request import Goal, render_request
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.rendering import choose, probing
from xrds_blender.rendering.explain import explain
from xrds_core.errors import UsageError, XRDSError

XRDS = Settings(Mode.X4, None, Denoising.HIGH_FAST, "fast", 1)
PLAIN = Settings(Mode.CYCLES_ONLY, None, Denoising.FAST_FAST).family
FULL = Settings(Mode.FULL_SIZE, None, Denoising.XRDS_FAST).family
BEST = Settings(Mode.FULL_SIZE, None, Denoising.XRDS_BEST).family


# So dear that four samples are many: no test depends on how busy the machine is.
COSTS = budget.Costs(
    fixed=1.0,
    beauty=100.0,
    guide=50.0,
    denoise=dict.fromkeys(Denoising, 10.0),
    network={XRDS.network: 1.0},
)


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Leave the picker nothing but these families, each as good as it is told."""

    def leave(**psnr: float) -> None:
        families = {"xrds": XRDS, "plain": PLAIN, "full": FULL, "best": BEST}
        curves = {
            families[name]: budget.Curve((1, 16), (best - 4, best))
            for name, best in psnr.items()
        }
        errors = budget.ErrorModel(curves)
        model = replace(budget.shipped(), errors=errors)
        monkeypatch.setattr(budget, "shipped", lambda: model)
        monkeypatch.setattr(choose, "_denoising", lambda: tuple(Denoising))
        monkeypatch.setattr(choose, "probe", lambda *_: COSTS)
        monkeypatch.setattr(choose, "with_guides", lambda costs, _: costs)
        monkeypatch.setattr(probing, "network_seconds_per_pixel", lambda *_: 1e-6)

    return leave


def test_probes_measure_the_scene(still_life: Callable[..., Any]) -> None:
    networks = [XRDS.network]
    start = time.perf_counter()

    def probe(passes: Any) -> tuple[budget.Costs, budget.Costs]:
        costs = probing.probe(passes, budget.shipped(), networks, start)
        return costs, probing.with_guides(costs, passes)

    costs, true = run_job(still_life(400, 300), probe)
    assert min(costs.fixed, costs.beauty, true.guide) > 0
    assert costs.guide < costs.beauty
    assert costs.fixed < true.fixed < time.perf_counter() - start + 1
    assert set(costs.denoise) == set(Denoising)
    assert min(costs.denoise.values()) > 0
    assert set(costs.network) == set(networks)


def test_a_sample_is_never_for_nothing() -> None:
    class Passes:
        """Of a frame so small that its size makes no difference."""

        def beauty(self, *_: Any, **__: Any) -> Any:
            return SimpleNamespace(seconds={"beauty": 0.02})

    assert probing._sample_seconds(Passes(), 4) > 0.0


def test_guides_are_timed_only_where_super_resolution_may_win(
    still_life: Callable[..., Any],
    only: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    timed: list[budget.Costs] = []

    def with_guides(costs: budget.Costs, _: Any) -> budget.Costs:
        timed.append(costs)
        return replace(costs, guide=500.0)

    only(xrds=20.0, plain=40.0)
    monkeypatch.setattr(choose, "with_guides", with_guides)
    assert render(still_life(64, 48), time_budget=500.0).settings.is_cycles_only
    assert not timed
    only(xrds=40.0, plain=20.0)
    monkeypatch.setattr(choose, "with_guides", with_guides)
    assert render(
        still_life(64, 48), time_budget=500.0
    ).settings.is_cycles_only  # too dear in truth
    assert len(timed) == 1


def test_plan_tells_what_was_chosen_and_why(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(xrds=40.0, plain=20.0)
    picture = render(still_life(160, 96), time_budget=500.0)
    decision = picture.plan[0]
    assert decision.decision == "time budget"
    assert decision.value.startswith("fast x4")
    assert "dB expected in" in decision.reason
    assert "best Cycles only for 500 s" in decision.reason
    settings = picture.settings
    assert (settings.mode, settings.guide_samples) == (Mode.X4, 1)
    assert picture.radiance.shape == (96, 160, 3)
    assert picture.low_resolution.shape == (24, 40, 3)
    assert picture.seconds["network"] > 0


def test_plain_is_rendered_where_it_is_better(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(xrds=20.0, plain=40.0)
    picture = render(still_life(160, 96), time_budget=500.0)
    assert picture.settings.is_cycles_only
    assert picture.settings.samples == 4
    assert picture.low_resolution is None
    assert picture.plan[0].value.startswith("Cycles only")
    assert "best super-resolution" in picture.plan[0].reason


def test_too_little_time_renders_the_fastest(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(plain=40.0)
    picture = render(still_life(160, 96), time_budget=0.001)
    assert picture.settings.samples == 1
    assert "too short for this scene" in picture.plan[0].reason


def test_quality_asks_for_no_more_than_it_needs(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    only(plain=40.0)
    picture = render(still_life(160, 96), quality=38.0)
    assert picture.settings.samples == 4  # 36 dB at one sample, 40 at 16
    assert picture.plan[0].decision == "quality"


@pytest.mark.parametrize("has_own", [True, False])
def test_full_size_is_denoised_by_ours_in_any_blender(
    still_life: Callable[..., Any],
    only: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    has_own: bool,
) -> None:
    pytest.importorskip("mitsuba_oidn")
    monkeypatch.setattr(choose, "has_denoiser", lambda: has_own)
    only(full=40.0)
    picture = render(still_life(64, 48), quality=38.0)
    settings = picture.settings
    found = settings.mode, settings.denoising
    assert found == (Mode.FULL_SIZE, Denoising.XRDS_FAST)
    assert picture.plan[0].value == "full size, 4 samples, fast denoising"
    assert picture.seconds["denoise"] > 0.0


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
    pytest.importorskip("mitsuba_oidn")
    only(full=40.0, best=41.0)
    costs = replace(
        COSTS, denoise=COSTS.denoise | {Denoising.XRDS_BEST: seconds_of_best}
    )
    monkeypatch.setattr(choose, "probe", lambda *_: costs)
    picture = render(still_life(64, 48), time_budget=500.0)
    # Four samples were foreseen to take 400 s; in truth there is all the time.
    assert picture.plan[0].value == "full size, 4 samples, fast denoising"
    assert (picture.settings.samples, picture.settings.quality) == (4, quality)
    told = [each.value for each in picture.plan if each.decision == "denoise in time"]
    assert told == [quality] * (quality == "best")


def test_what_is_late_by_intent_keeps_its_denoiser(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    pytest.importorskip("mitsuba_oidn")
    only(full=40.0, best=41.0)
    picture = render(still_life(64, 48), time_budget=0.001)
    # As dear as the quickest by what is foreseen, and late whatever is taken.
    assert picture.settings.quality == "best"
    assert "denoise in time" not in [each.decision for each in picture.plan]


def test_nothing_is_promised_where_nothing_denoises(
    still_life: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choose, "has_denoiser", lambda: False)
    monkeypatch.setattr(choose.loading, "has_library", lambda: False)
    with pytest.raises(XRDSError, match=r"has Open Image Denoise.*install XRDS"):
        render(still_life(64, 48), time_budget=5.0)


@pytest.mark.parametrize("best", ["xrds", "plain", "full"])
@pytest.mark.parametrize("goal", [{"time_budget": 500.0}, {"quality": 39.0}])
def test_the_plan_told_is_the_one_rendered(
    still_life: Callable[..., Any],
    only: Callable[..., None],
    best: str,
    goal: dict[str, float],
) -> None:
    only(**{name: 40.0 if name == best else 20.0 for name in ("xrds", "plain", "full")})
    ensure_registered()
    scene = still_life(64, 48)
    told = explain(scene, render_request(**goal))
    picture = render(scene, **goal)
    before = [(each["decision"], each["value"]) for each in told["decisions"]]
    decided = [(each.decision, each.value) for each in picture.plan]
    assert before == decided[: len(before)]
    assert before[0][0] == next(iter(goal)).replace("_", " ")
    assert told["facts"]["scale"] == picture.settings.scale
    # What is left is what only a render can know.
    rest = {decision for decision, _ in decided[len(before) :]}
    assert rest <= {"guide cache", "sessions", "guide prefilter", "denoise in time"}


def test_the_denoiser_is_the_chosen_one_and_the_scene_is_as_before(
    still_life: Callable[..., Any], only: Callable[..., None]
) -> None:
    if not session.has_denoiser():
        pytest.skip("this Blender has no OpenImageDenoise")
    only(plain=40.0)
    scene = still_life(64, 48, 7)
    noisy = render(scene, plain=True, samples=4, seed=3)
    quick = render(scene, plain=True, samples=4, seed=3, denoiser="FAST-FAST")
    best = render(scene, plain=True, samples=4, seed=3, denoiser="HIGH-ACCURATE")
    spread = [abs(noisy.radiance - p.radiance).max() for p in (quick, best)]
    assert min(spread) > 0
    assert abs(quick.radiance - best.radiance).max() > 0
    render(scene, time_budget=300.0)
    cycles = scene.cycles
    assert (cycles.samples, cycles.use_denoising) == (7, False)


def test_panel_setting_reaches_the_job(still_life: Callable[..., Any]) -> None:
    scene = still_life()
    from xrds_blender.interface.properties import request_of
    from xrds_blender.interface.registration import ensure_registered

    ensure_registered()
    scene.xrds.time_budget = 12.5
    assert request_of(scene.xrds).goal is None
    scene.xrds.use_time_budget = True
    assert request_of(scene.xrds).goal == Goal(12.5)
    scene.xrds.mode = "x2"  # chosen by hand: nothing is left open
    found = request_of(scene.xrds)
    assert (found.goal, found.settings.mode) == (None, Mode.X2)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"time_budget": 0.0}, "must be above 0"),
        ({"time_budget": 5.0, "quality": 30.0}, "not both"),
        ({"denoiser": "BEST"}, "HIGH-ACCURATE"),
    ],
)
def test_wrong_wishes_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        render_request(**wrong)
