"""The picker: pure functions of costs and expected errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xrds_blender.planning import budget
from xrds_blender.planning.budget import Costs, Curve, ErrorModel
from xrds_blender.planning.request import Goal
from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising, Mode, Settings


def at_full_size(denoising: Denoising, samples: int | None = None) -> Settings:
    mode = Mode.FULL_SIZE if denoising.is_ours else Mode.CYCLES_ONLY
    return Settings(mode, samples, denoising, "", 0)


PLAIN, QUICK = map(at_full_size, (Denoising.HIGH_ACCURATE, Denoising.FAST_FAST))
LOW = Settings(Mode.X4, None, Denoising.HIGH_FAST, "fast", 2)
TWICE = Settings(Mode.X2, None, Denoising.HIGH_FAST, "fast", 1)
NETWORKS = [LOW.network, TWICE.network]
ERRORS = ErrorModel(
    {
        PLAIN: Curve((1, 4, 16), (24.0, 29.0, 33.0)),
        QUICK: Curve((1, 4, 16), (22.0, 26.0, 30.0)),
        LOW: Curve((4, 16, 64), (23.0, 25.0, 25.5)),
        TWICE: Curve((4, 16), (25.0, 27.0)),
    }
)
COSTS = Costs(
    fixed=1.0,
    beauty=4.0,
    guide=2.0,
    denoise={"HIGH-ACCURATE": 24.0, "HIGH-FAST": 4.0, "FAST-FAST": 2.0},
    network={LOW.network: 3.0, TWICE.network: 3.0},
)
positive = st.floats(0.01, 100.0)


def choose(seconds: float, costs: Costs = COSTS) -> budget.Selection:
    return budget.choose(seconds, costs, ERRORS, NETWORKS)


def test_seconds_are_the_sum_of_the_parts() -> None:
    assert COSTS.seconds(replace(PLAIN, samples=3)) == 1 + 24 + 3 * 4
    low = 1 + 4 / 16 + 2 * 2 + 3 + 8 * 4 / 16
    assert COSTS.seconds(replace(LOW, samples=8)) == low
    twice = 1 + 4 / 4 + 1 * 2 + 3 + 8 * 4 / 4
    assert COSTS.seconds(replace(TWICE, samples=8)) == twice


def test_curve_is_linear_in_doublings_and_goes_on() -> None:
    curve = Curve((1, 4), (20.0, 24.0))
    assert [curve.at(n) for n in (1, 2, 4, 16)] == [20.0, 22.0, 24.0, 24.0]


def test_a_shot_pays_for_its_neighbours_and_for_no_probes() -> None:
    costs = replace(COSTS, fixed=5.0, probes=4.0)
    plain = replace(PLAIN, samples=3)
    low, reuse = (
        replace(LOW, samples=8),
        2 * 4 * budget.ACCUMULATION * 2.0,
    )  # of the quickest denoiser's seconds
    alone = COSTS.denoise[plain.denoising]  # the frame by itself
    assert costs.in_shot(4).seconds(plain) == pytest.approx(
        COSTS.seconds(plain) + reuse + alone
    )
    assert costs.in_shot(4).seconds(low) == pytest.approx(COSTS.seconds(low) + reuse)
    assert costs.in_shot(0).seconds(plain) == COSTS.seconds(plain)


def test_in_a_shot_a_sample_counts_for_more() -> None:
    shot = ERRORS.in_shot(3)  # three neighbours' worth and its own
    assert shot.psnr(replace(PLAIN, samples=1)) == ERRORS.psnr(
        replace(PLAIN, samples=4)
    )
    assert ERRORS.in_shot(0).psnr(replace(PLAIN, samples=1)) == 24.0


def test_curve_never_falls() -> None:
    assert Curve.of({1: 20.0, 2: 25.0, 4: 24.0}).psnr == (20.0, 25.0, 25.0)


@given(st.tuples(positive, positive), positive, positive, positive, positive)
def test_more_budget_never_expects_more_error(
    budgets: tuple[float, float],
    fixed: float,
    beauty: float,
    guide: float,
    denoise: float,
) -> None:
    modes = {name: denoise * x for name, x in COSTS.denoise.items()}
    costs = Costs(fixed, beauty, guide, modes, COSTS.network)
    less, more = (choose(seconds, costs) for seconds in sorted(budgets))
    if less.fits:
        assert more.psnr >= less.psnr


@given(st.floats(0.1, 1000.0))
def test_what_is_chosen_keeps_to_the_budget(seconds: float) -> None:
    selected = choose(seconds)
    assert selected.seconds == COSTS.seconds(selected.settings)
    assert selected.fits == (selected.seconds <= seconds * budget.AIM)
    assert selected.psnr == ERRORS.psnr(selected.settings)


@given(st.floats(5.0, 1000.0))
def test_nothing_that_fits_is_better(seconds: float) -> None:
    selected = choose(seconds)
    for family in ERRORS.curves:
        for samples in (1, 2, 4, 16, 64, 256):
            other = replace(family, samples=samples)
            fits = COSTS.seconds(other) <= seconds * budget.AIM
            if fits and samples >= ERRORS.curves[family].samples[0]:
                assert ERRORS.psnr(other) <= selected.psnr + 1e-9


def test_a_budget_below_all_takes_the_fastest_and_says_so() -> None:
    selected = choose(2.0)
    assert not selected.fits
    assert selected.settings == replace(QUICK, samples=1)  # 7 s, and XRDS 9.25 s
    decision = selected.decision(Goal(2.0))
    assert "\n" not in decision.reason
    assert decision.reason.startswith("2 s is too short for this scene; the nearest")


def test_full_size_may_be_a_little_late_where_only_super_resolution_fits() -> None:
    errors = ErrorModel({QUICK: ERRORS.curves[QUICK], LOW: Curve((4,), (15.0,))})
    quick = COSTS.seconds(replace(QUICK, samples=1))  # 7 s; LOW takes 5.45 s

    def chosen(budget_seconds: float) -> budget.Selection:
        cheap = replace(COSTS, guide=0.1)
        return budget.choose(budget_seconds, cheap, errors, NETWORKS)

    late = chosen(quick / 1.05)
    assert (late.settings.scale, late.fits) == (1, False)
    assert "too short" in late.decision(Goal(quick / 1.05)).reason
    early = chosen(quick / 1.2)
    assert (early.settings.scale, early.fits) == (4, True)


OURS = ErrorModel(
    {
        at_full_size(mode): Curve((1, 16), (best - 8, best))
        for mode, best in {
            Denoising.XRDS_FAST: 30.0,
            Denoising.XRDS_MEDIUM: 32.0,
            Denoising.XRDS_HIGH: 34.0,
            Denoising.XRDS_BEST: 34.5,
        }.items()
    }
)
OUR_COSTS = replace(
    COSTS,
    denoise={
        "XRDS-FAST": 1.0,
        "XRDS-MEDIUM": 4.0,
        "XRDS-HIGH": 6.0,
        "XRDS-BEST": 11.0,
    },
)


@pytest.mark.parametrize(
    ("left", "denoiser"),
    [
        (12.0, Denoising.XRDS_BEST),  # the samples took less than expected
        (10.9, Denoising.XRDS_HIGH),
        (5.9, Denoising.XRDS_HIGH),  # what was chosen may be a little late
        (4.9, Denoising.XRDS_MEDIUM),
        (3.1, Denoising.XRDS_MEDIUM),
        (2.9, Denoising.XRDS_FAST),
        (-3.0, Denoising.XRDS_FAST),
        (-60.0, Denoising.XRDS_HIGH),  # five seconds more are nothing then
    ],
)
def test_samples_get_the_best_denoiser_for_the_seconds_left(
    left: float, denoiser: Denoising
) -> None:
    chosen = at_full_size(Denoising.XRDS_HIGH, 4)
    found = budget.denoiser_in_time(20.0 - left, 20.0, chosen, OUR_COSTS, OURS)
    assert found is denoiser


def test_of_choices_as_fast_as_the_fastest_the_better_is_taken() -> None:
    modes = COSTS.denoise | {"HIGH-ACCURATE": 2.4}  # 7.4 s beside 7 s
    selected = choose(2.0, replace(COSTS, denoise=modes))
    assert not selected.fits
    assert selected.settings == replace(PLAIN, samples=1)


def test_plain_is_taken_where_it_is_better_and_xrds_named_beside() -> None:
    selected = choose(300.0)
    assert selected.settings.scale == 1
    decision = selected.decision(Goal(300.0))
    assert (
        decision.value
        == f"Cycles only, {selected.settings.samples} samples, OIDN HIGH-ACCURATE"
    )
    assert "best super-resolution for 300 s: fast x2" in decision.reason


def test_xrds_is_taken_where_the_denoiser_leaves_no_time() -> None:
    dear = replace(COSTS, denoise=dict.fromkeys(COSTS.denoise, 40.0))
    selected = choose(20.0, dear)
    assert selected.settings.scale > 1
    assert selected.rival is None
    assert "the only method" in selected.decision(Goal(20.0)).reason


def test_denoisers_that_are_not_there_are_not_chosen() -> None:
    ours = at_full_size(Denoising.XRDS_HIGH)
    errors = ErrorModel({**ERRORS.curves, ours: Curve((1, 4, 16), (24.0, 29.0, 33.0))})
    costs = replace(COSTS, denoise={**COSTS.denoise, Denoising.XRDS_HIGH: 14.0})
    selected = budget.choose(60.0, costs, errors, [])
    assert selected.settings.denoising is Denoising.XRDS_HIGH  # more samples fit
    assert selected.settings.label == "full size, 10 samples, high denoising"
    assert "best Cycles only for 60 s" in selected.decision(Goal(60.0)).reason
    left = errors.limited({Denoising.HIGH_ACCURATE})
    assert budget.choose(60.0, costs, left, []).settings.denoising == "HIGH-ACCURATE"
    assert set(left.curves) == {PLAIN, LOW, TWICE}


def test_networks_without_weights_are_not_chosen() -> None:
    dear = replace(COSTS, denoise=dict.fromkeys(COSTS.denoise, 40.0), network={})
    assert budget.choose(60.0, dear, ERRORS, []).settings.scale == 1


@given(st.floats(20.0, 40.0))
def test_quality_is_reached_in_the_least_seconds(psnr: float) -> None:
    selected = budget.reach(psnr, COSTS, ERRORS, NETWORKS)
    if not selected.fits:
        assert selected.psnr < psnr
        return
    assert selected.psnr >= psnr
    fewer = replace(selected.settings, samples=selected.settings.samples - 1)
    family = fewer.family
    if fewer.samples >= ERRORS.curves[family].samples[0]:
        assert ERRORS.psnr(fewer) < psnr
    if selected.rival is not None:
        assert selected.rival.seconds >= selected.seconds


def test_unreachable_quality_takes_the_best_and_says_so() -> None:
    selected = budget.reach(90.0, COSTS, ERRORS, NETWORKS)
    assert selected.decision(Goal(decibels=90.0)).reason.startswith("90 dB is beyond")


def test_shipped_model_is_whole() -> None:
    model = budget.shipped()
    assert set(model.denoiser_speed) == set(Denoising)
    assert model.denoiser_speed[DEFAULT_DENOISING] == pytest.approx(1.0)
    assert any(family.is_enlarged for family in model.errors.curves)
    for family, curve in model.errors.curves.items():
        assert family == family.family
        assert family.denoising in model.denoiser_speed
        assert not family.is_enlarged or family.network in model.network_speed
        assert list(curve.psnr) == sorted(curve.psnr)


def test_model_survives_its_file(tmp_path: Path) -> None:
    model = budget.Model(ERRORS, COSTS.denoise, COSTS.network, 0.2, "four scenes")
    file = tmp_path / "budget.json"
    file.write_text(json.dumps(model.to_json()), "utf-8")
    assert budget.Model.read(file) == model
