"""What an animation takes, and what XRDS offers: the arithmetic, by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from xrds_blender.planning.budget import Curve
from xrds_blender.planning.estimates import Measured, learn
from xrds_blender.planning.offers import (
    NOTHING_GAINED,
    NOTHING_SAVED,
    Animation,
    Kind,
    Offer,
    cycles_line,
    offer_line,
    offers,
    source_line,
)
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.planning.shot_figures import (
    FILE,
    CameraFigures,
    Points,
    ShotFigures,
    shipped,
)
from xrds_lab.pages.shot_figures import figures

MOVING = CameraFigures(
    gain=Points.of({4: 3.0, 64: 2.0}),
    flicker=Points.of({4: 0.6, 64: 0.8}),
    same_flicker=0.98,
)
STILL = replace(MOVING, same_flicker=0.4)
FIGURES = ShotFigures(
    MOVING,
    STILL,
    share=Points.of({16: 0.25, 64: 0.5}),
    threshold_share=0.6,
    by_radius=Points.of({1: 0.4, 4: 1.0}),
    accumulate=0.01,
    again=0.2,
)
CURVE = Curve.of({1: 30.0, 16: 38.0, 64: 42.0})
# A frame of 64 samples: in Cycles 64 + 6 s, in XRDS 64 + 4 s.
SHOT = Animation(100, 64, cycles=70.0, fixed=4.0, sample=1.0, radius=4, measuring=2.0)


def found(animation: Animation) -> dict[Kind, Offer]:
    return {x.kind: x for x in offers(animation, CURVE, FIGURES).offers}


def test_the_same_picture_takes_a_share_of_the_samples() -> None:
    same = found(SHOT)[Kind.PICTURE]
    assert same.samples == 32
    # late frames, and what two frames of all samples measure
    assert same.seconds == 100 * (4 + 32) + 2 * 64
    assert not same.is_measured
    here = found(replace(SHOT, share=0.25))[Kind.PICTURE]
    assert (here.samples, here.is_measured) == (16, True)
    still = found(replace(SHOT, is_still=True))[Kind.PICTURE]
    assert (still.samples, still.flicker) == (32, 0.4)
    adaptive = found(replace(SHOT, has_threshold=True))
    assert adaptive[Kind.PICTURE].samples == pytest.approx(0.6 * 64)
    assert Kind.TIME not in adaptive  # what its samples are is not known


def test_the_same_time_has_as_many_samples_as_fit() -> None:
    in_time = found(SHOT)[Kind.TIME]
    assert in_time.samples == 66
    assert in_time.seconds == 7000.0
    assert in_time.decibels == pytest.approx(2.0 + 2.0 * 0.0444, abs=0.001)
    assert in_time.flicker == pytest.approx(0.8, abs=0.01)


def test_where_finishing_takes_all_the_time_nothing_is_saved() -> None:
    quick = replace(SHOT, cycles=3.0, fixed=4.0, sample=0.02)
    assert list(found(quick)) == [Kind.SAMPLES]
    same = found(quick)[Kind.SAMPLES]
    assert same.decibels == 2.0
    assert same.seconds == pytest.approx(100 * (4 + 1.28))
    all_of_it = offers(quick, CURVE, FIGURES)
    assert source_line(all_of_it) == NOTHING_SAVED
    few = replace(SHOT, fixed=66.0)  # four samples are left of 64, far noisier
    assert Kind.TIME not in found(few)
    assert Kind.SAMPLES in found(few)


def test_frames_that_cannot_use_each_other_have_no_offer() -> None:
    alone = offers(replace(SHOT, radius=0), CURVE, FIGURES)
    assert alone.offers == ()
    assert source_line(alone) == NOTHING_GAINED
    assert Kind.PICTURE not in found(replace(SHOT, obstacle="too few frames"))


def test_sentences() -> None:
    whole = offers(SHOT, CURVE, FIGURES)
    assert cycles_line(whole) == "This animation in Cycles, 100 frames: 1 h 57 min"
    noisy = replace(whole, animation=replace(SHOT, is_noisy=True))
    assert "in Cycles, not denoised, 100 frames" in cycles_line(noisy)
    same, in_time = (offer_line(x, SHOT) for x in whole.offers)
    assert same == "The same picture: 62 min, 32 samples a frame"
    assert in_time == (
        "The same time, cleaner: +2.1 dB, 66 samples a frame, 21 % less flicker"
    )
    before = replace(SHOT, cycles=None, fixed=None, sample=0.0)
    untimed = offers(before, CURVE, FIGURES)
    assert "F12" in cycles_line(untimed)
    lines = [offer_line(x, before) for x in untimed.offers]
    assert lines == [
        "The same picture, 32 samples a frame",
        "The same samples: +2.0 dB, 20 % less flicker",
    ]


def test_a_radius_gains_its_part() -> None:
    assert FIGURES.gain(4, 4, is_still=False) == 3.0
    assert FIGURES.gain(4, 1, is_still=False) == pytest.approx(1.2)
    assert FIGURES.gain(4, 0, is_still=False) == 0.0
    assert FIGURES.flicker(4, 1, is_still=False) == pytest.approx(1 - 0.4 * 0.4)
    assert FIGURES.gain(16, 4, is_still=False) == pytest.approx(2.5)
    assert FIGURES.gain(1024, 32, is_still=False) == 2.0


def test_shipped_figures_are_those_of_the_results() -> None:
    assert json.loads(FILE.read_text("utf-8")) == figures()
    assert shipped().gain(16, 4, is_still=False) > 2.0


def test_a_shots_denoising_counts_once() -> None:
    from xrds_blender.planning import budget

    model, pixels = budget.shipped(), 1000
    ours = Settings(Mode.FULL_SIZE, 16, Denoising.XRDS_HIGH)
    stages = {
        "sync": 1.0,
        "beauty": 32.0,
        "accumulate": 0.5,
        "denoise": 5.0,
        "again": 1.5,
        "total": 200.0,  # the frames ahead were sampled in it
    }
    known = learn(None, ours, pixels, stages, model)
    assert known.seconds(ours, pixels, model, 4) == pytest.approx(40.0)
    assert known.seconds(ours, pixels, model) == pytest.approx(38.0)  # by itself
    more = known.seconds(replace(ours, samples=32), pixels, model, 4)
    assert more == pytest.approx(72.0)
    # frames of one job: the mean of them
    dearer = stages | {"beauty": 64.0}
    second = learn(known, ours, pixels, dearer, model, frame=2)
    assert second.beauty == 3.0
    third = learn(second, ours, pixels, dearer, model, frame=3, share=0.25)
    assert third.beauty == pytest.approx(10.0 / 3.0)
    assert third.share == 0.25


def test_neighbours_are_expected_before_a_shot_was_rendered() -> None:
    from xrds_blender.planning import budget

    model = budget.shipped()
    ours = Settings(Mode.FULL_SIZE, 16, Denoising.XRDS_HIGH)
    still = {"sync": 1.0, "beauty": 16.0, "denoise": 5.0, "load": 2.0, "total": 25.0}
    known = learn(None, ours, 1000, still, model)
    assert known.fixed == 2.0  # what no stage has counts, but loading
    alone = known.seconds(ours, 1000, model)
    assert alone == 23.0
    expected = alone + 5.0 * (8 * shipped().accumulate + shipped().again)
    assert known.seconds(ours, 1000, model, 4) == pytest.approx(expected)
    assert Measured(1000).seconds(ours, 1000, model, 4) is None
