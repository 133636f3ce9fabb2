"""What fits into a time budget: pure functions of costs and expected errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xrds_blender.planning import budget
from xrds_blender.planning.budget import Costs, Curve, ErrorModel
from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising, Mode, Settings


def at_full_size(denoising: Denoising, samples: int | None = None) -> Settings:
    mode = Mode.FULL_SIZE if denoising.is_ours else Mode.CYCLES_ONLY
    return Settings(mode, samples, denoising, "", 0)


PLAIN, QUICK = map(at_full_size, (Denoising.HIGH_ACCURATE, Denoising.FAST_FAST))
LOW = Settings(Mode.X4, None, Denoising.HIGH_FAST, "fast", 2)
TWICE = Settings(Mode.X2, None, Denoising.HIGH_FAST, "fast", 1)
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


def test_seconds_are_the_sum_of_the_parts() -> None:
    assert COSTS.seconds(replace(PLAIN, samples=3)) == 1 + 24 + 3 * 4
    low = 1 + 4 / 16 + 2 * 2 + 3 + 8 * 4 / 16
    assert COSTS.seconds(replace(LOW, samples=8)) == low
    twice = 1 + 4 / 4 + 1 * 2 + 3 + 8 * 4 / 4
    assert COSTS.seconds(replace(TWICE, samples=8)) == twice


def test_curve_is_linear_in_doublings_and_goes_on() -> None:
    curve = Curve((1, 4), (20.0, 24.0))
    assert [curve.at(n) for n in (1, 2, 4, 16)] == [20.0, 22.0, 24.0, 24.0]


def test_curve_never_falls() -> None:
    assert Curve.of({1: 20.0, 2: 25.0, 4: 24.0}).psnr == (20.0, 25.0, 25.0)


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
    chosen = budget.Selection(4, Denoising.XRDS_HIGH, 19.0, 30.0)
    found = budget.denoiser_in_time(20.0 - left, 20.0, chosen, OUR_COSTS, OURS)
    assert found is denoiser


positive = st.floats(0.01, 100.0)


@given(st.tuples(positive, positive), positive, positive, positive)
def test_more_budget_never_expects_more_error(
    budgets: tuple[float, float], fixed: float, beauty: float, denoise: float
) -> None:
    modes = {name: denoise * x for name, x in OUR_COSTS.denoise.items()}
    costs = Costs(fixed, beauty, 0.0, modes, {})
    less, more = (budget.choose(x, costs, OURS) for x in sorted(budgets))
    if less.fits:
        assert more.psnr >= less.psnr


@given(st.floats(0.1, 1000.0))
def test_what_is_chosen_keeps_to_the_budget(seconds: float) -> None:
    selected = budget.choose(seconds, OUR_COSTS, OURS)
    settings = at_full_size(selected.denoising, selected.samples)
    assert selected.seconds == OUR_COSTS.seconds(settings)
    assert selected.fits == (selected.seconds <= seconds * budget.AIM)
    assert selected.psnr == OURS.psnr(settings)


@given(st.floats(7.0, 1000.0))
def test_nothing_that_fits_is_better(seconds: float) -> None:
    selected = budget.choose(seconds, OUR_COSTS, OURS)
    for denoising, curve in OURS.full_size.items():
        for samples in (1, 2, 4, 16, 64, 256):
            other = OUR_COSTS.seconds(at_full_size(denoising, samples))
            if other <= seconds * budget.AIM:
                assert curve.at(samples) <= selected.psnr + 1e-9


def test_a_budget_below_all_takes_the_fastest_and_says_so() -> None:
    selected = budget.choose(2.0, OUR_COSTS, OURS)
    found = selected.samples, selected.denoising, selected.fits
    assert found == (1, Denoising.XRDS_FAST, False)  # 6 s
    reason = selected.decision(2.0).reason
    assert "\n" not in reason
    assert reason.startswith("2 s is too short for this scene; the nearest")


def test_of_choices_as_fast_as_the_fastest_the_better_is_taken() -> None:
    modes = OUR_COSTS.denoise | {"XRDS-HIGH": 1.4}  # 6.4 s beside 6 s
    selected = budget.choose(2.0, replace(OUR_COSTS, denoise=modes), OURS)
    assert (selected.denoising, selected.fits) == (Denoising.XRDS_HIGH, False)


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
