"""The picker: pure functions of costs and expected errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xrds_blender.planning import budget
from xrds_blender.planning.budget import Choice, Costs, Curve, ErrorModel
from xrds_blender.planning.denoiser import DEFAULT_DENOISER, Denoiser

PLAIN, QUICK = Choice(Denoiser.HIGH_ACCURATE, 0), Choice(Denoiser.FAST_FAST, 0)
LOW = Choice(Denoiser.HIGH_FAST, 0, 4, "fast", 2)
HALF = Choice(Denoiser.HIGH_FAST, 0, 2, "fast", 1)
NETWORKS = [LOW.network, HALF.network]
ERRORS = ErrorModel(
    {
        PLAIN: Curve((1, 4, 16), (24.0, 29.0, 33.0)),
        QUICK: Curve((1, 4, 16), (22.0, 26.0, 30.0)),
        LOW: Curve((4, 16, 64), (23.0, 25.0, 25.5)),
        HALF: Curve((4, 16), (25.0, 27.0)),
    }
)
COSTS = Costs(
    fixed=1.0,
    beauty=4.0,
    guide=2.0,
    denoise={"HIGH-ACCURATE": 24.0, "HIGH-FAST": 4.0, "FAST-FAST": 2.0},
    network={LOW.network: 3.0, HALF.network: 3.0},
)
positive = st.floats(0.01, 100.0)


def choose(seconds: float, costs: Costs = COSTS) -> budget.Picked:
    return budget.choose(seconds, costs, ERRORS, NETWORKS)


def test_seconds_are_the_sum_of_the_parts() -> None:
    assert COSTS.seconds(replace(PLAIN, samples=3)) == 1 + 24 + 3 * 4
    low = 1 + 4 / 16 + 2 * 2 + 3 + 8 * 4 / 16
    assert COSTS.seconds(replace(LOW, samples=8)) == low
    half = 1 + 4 / 4 + 1 * 2 + 3 + 8 * 4 / 4
    assert COSTS.seconds(replace(HALF, samples=8)) == half


def test_curve_is_linear_in_doublings_and_goes_on() -> None:
    curve = Curve((1, 4), (20.0, 24.0))
    assert [curve.at(n) for n in (1, 2, 4, 16)] == [20.0, 22.0, 24.0, 24.0]


def test_a_shot_pays_for_what_its_frames_lend_and_for_no_probes() -> None:
    costs = replace(COSTS, fixed=5.0, probes=4.0)
    plain = replace(PLAIN, samples=3)
    lending = 2 * 4 * budget.ACCUMULATION * 2.0  # of the quickest denoiser's seconds
    alone = COSTS.denoise[plain.denoiser]  # the frame by itself
    assert costs.in_shot(4).seconds(plain) == pytest.approx(
        COSTS.seconds(plain) + lending + alone
    )
    assert costs.in_shot(4).seconds(LOW) == pytest.approx(COSTS.seconds(LOW) + lending)
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
    picked = choose(seconds)
    assert picked.seconds == COSTS.seconds(picked.choice)
    assert picked.fits == (picked.seconds <= seconds * budget.AIM)
    assert picked.psnr == ERRORS.psnr(picked.choice)


@given(st.floats(5.0, 1000.0))
def test_nothing_that_fits_is_better(seconds: float) -> None:
    picked = choose(seconds)
    for family in ERRORS.curves:
        for samples in (1, 2, 4, 16, 64, 256):
            other = replace(family, samples=samples)
            fits = COSTS.seconds(other) <= seconds * budget.AIM
            if fits and samples >= ERRORS.curves[family].samples[0]:
                assert ERRORS.psnr(other) <= picked.psnr + 1e-9


def test_a_budget_below_all_takes_the_fastest_and_says_so() -> None:
    picked = choose(2.0)
    assert not picked.fits
    assert picked.choice == replace(QUICK, samples=1)  # 7 s, and XRDS 9.25 s
    decision = picked.decision(2.0)
    assert "\n" not in decision.reason
    assert decision.reason.startswith("2 s is too short for this scene; the nearest")


def test_full_size_may_be_a_little_late_where_only_super_resolution_fits() -> None:
    errors = ErrorModel({QUICK: ERRORS.curves[QUICK], LOW: Curve((4,), (15.0,))})
    quick = COSTS.seconds(replace(QUICK, samples=1))  # 7 s; LOW takes 5.45 s

    def chosen(budget_seconds: float) -> budget.Picked:
        cheap = replace(COSTS, guide=0.1)
        return budget.choose(budget_seconds, cheap, errors, NETWORKS)

    late = chosen(quick / 1.05)
    assert (late.choice.scale, late.fits) == (1, False)
    assert "too short" in late.decision(quick / 1.05).reason
    early = chosen(quick / 1.2)
    assert (early.choice.scale, early.fits) == (4, True)


OURS = ErrorModel(
    {
        Choice(mode, 0): Curve((1, 16), (best - 8, best))
        for mode, best in {
            Denoiser.XRDS_FAST: 30.0,
            Denoiser.XRDS_MEDIUM: 32.0,
            Denoiser.XRDS_HIGH: 34.0,
            Denoiser.XRDS_BEST: 34.5,
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
        (12.0, Denoiser.XRDS_BEST),  # the samples took less than expected
        (10.9, Denoiser.XRDS_HIGH),
        (5.9, Denoiser.XRDS_HIGH),  # what was chosen may be a little late
        (4.9, Denoiser.XRDS_MEDIUM),
        (3.1, Denoiser.XRDS_MEDIUM),
        (2.9, Denoiser.XRDS_FAST),
        (-3.0, Denoiser.XRDS_FAST),
        (-60.0, Denoiser.XRDS_HIGH),  # five seconds more are nothing then
    ],
)
def test_samples_get_the_best_denoiser_for_the_seconds_left(
    left: float, denoiser: Denoiser
) -> None:
    chosen = Choice(Denoiser.XRDS_HIGH, 4)
    found = budget.denoiser_in_time(20.0 - left, 20.0, chosen, OUR_COSTS, OURS)
    assert found is denoiser


def test_of_choices_as_fast_as_the_fastest_the_better_is_taken() -> None:
    modes = COSTS.denoise | {"HIGH-ACCURATE": 2.4}  # 7.4 s beside 7 s
    picked = choose(2.0, replace(COSTS, denoise=modes))
    assert not picked.fits
    assert picked.choice == replace(PLAIN, samples=1)


def test_plain_is_taken_where_it_is_better_and_xrds_named_beside() -> None:
    picked = choose(300.0)
    assert picked.choice.scale == 1
    decision = picked.decision(300.0)
    assert (
        decision.value == f"plain, {picked.choice.samples} samples, OIDN HIGH-ACCURATE"
    )
    assert "best super-resolution for 300 s: fast x2" in decision.reason


def test_xrds_is_taken_where_the_denoiser_leaves_no_time() -> None:
    dear = replace(COSTS, denoise=dict.fromkeys(COSTS.denoise, 40.0))
    picked = choose(20.0, dear)
    assert picked.choice.scale > 1
    assert picked.rival is None
    assert "the only method" in picked.decision(20.0).reason


def test_denoisers_that_are_not_there_are_not_chosen() -> None:
    ours = Choice(Denoiser.XRDS_HIGH, 0)
    errors = ErrorModel({**ERRORS.curves, ours: Curve((1, 4, 16), (24.0, 29.0, 33.0))})
    costs = replace(COSTS, denoise={**COSTS.denoise, Denoiser.XRDS_HIGH: 14.0})
    picked = budget.choose(60.0, costs, errors, [])
    assert picked.choice.denoiser is Denoiser.XRDS_HIGH  # more samples fit
    assert picked.choice.label == "full size, 10 samples, high denoising"
    assert "best plain for 60 s" in picked.decision(60.0).reason
    left = errors.limited({Denoiser.HIGH_ACCURATE})
    assert budget.choose(60.0, costs, left, []).choice.denoiser == "HIGH-ACCURATE"
    assert set(left.curves) == {PLAIN, LOW, HALF}


def test_networks_without_weights_are_not_chosen() -> None:
    dear = replace(COSTS, denoise=dict.fromkeys(COSTS.denoise, 40.0), network={})
    assert budget.choose(60.0, dear, ERRORS, []).choice.scale == 1


@given(st.floats(20.0, 40.0))
def test_quality_is_reached_in_the_least_seconds(psnr: float) -> None:
    picked = budget.reach(psnr, COSTS, ERRORS, NETWORKS)
    if not picked.fits:
        assert picked.psnr < psnr
        return
    assert picked.psnr >= psnr
    fewer = replace(picked.choice, samples=picked.choice.samples - 1)
    family = replace(fewer, samples=0)
    if fewer.samples >= ERRORS.curves[family].samples[0]:
        assert ERRORS.psnr(fewer) < psnr
    if picked.rival is not None:
        assert picked.rival.seconds >= picked.seconds


def test_unreachable_quality_takes_the_best_and_says_so() -> None:
    picked = budget.reach(90.0, COSTS, ERRORS, NETWORKS)
    assert picked.decision(90.0, in_seconds=False).reason.startswith("90 dB is beyond")


def test_shipped_model_is_whole() -> None:
    model = budget.shipped()
    assert set(model.denoiser_speed) == set(Denoiser)
    assert model.denoiser_speed[DEFAULT_DENOISER] == pytest.approx(1.0)
    assert any(choice.scale > 1 for choice in model.errors.curves)
    for choice, curve in model.errors.curves.items():
        assert choice.denoiser in model.denoiser_speed
        assert choice.scale == 1 or choice.network in model.network_speed
        assert list(curve.psnr) == sorted(curve.psnr)


def test_model_survives_its_file(tmp_path: Path) -> None:
    model = budget.Model(ERRORS, COSTS.denoise, COSTS.network, 0.2, "four scenes")
    file = tmp_path / "budget.json"
    file.write_text(json.dumps(model.to_json()), "utf-8")
    assert budget.Model.read(file) == model
