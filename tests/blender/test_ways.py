"""The ways side by side: what each needs, its decibels and its seconds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from xrds_blender.internals.lifetimes import FILE
from xrds_blender.planning import budget
from xrds_blender.planning.budget import Network
from xrds_blender.planning.denoiser import Denoiser
from xrds_blender.planning.measured import GUIDE_SHARE, Measured, learn
from xrds_blender.planning.ways import (
    WAYS,
    Asked,
    Means,
    Outlook,
    Way,
    best,
    choice_of,
    missing,
    outlooks,
)

MODEL = budget.shipped()
NETWORKS = frozenset(Network("fast", scale) for scale in (2, 4, 8))
ALL = Means(True, True, True, NETWORKS)
ASKED = Asked(samples=16)
PIXELS = 1920 * 1080


def looks(asked: Asked = ASKED, at_hand: Means = ALL) -> dict[Way, Outlook]:
    return {look.way: look for look in outlooks(asked, at_hand, MODEL)}


def test_a_way_is_that_of_its_job() -> None:
    for way in WAYS:
        assert Way.of(way.scale, way is Way.PLAIN) is way


def test_what_cannot_work_is_left_out_and_told() -> None:
    no_torch = replace(ALL, torch=False)
    assert set(looks(at_hand=no_torch)) == {Way.FULL_SIZE, Way.PLAIN}
    assert "PyTorch" in missing(Way.X2, ASKED, no_torch)
    x2 = replace(ALL, networks=frozenset({Network("fast", 2)}))
    assert set(looks(at_hand=x2)) == {Way.FULL_SIZE, Way.X2, Way.PLAIN}
    assert "weights" in missing(Way.X4, ASKED, x2)
    assert "Open Image Denoise" in missing(
        Way.FULL_SIZE, ASKED, replace(ALL, denoiser=False)
    )


@pytest.mark.parametrize("samples", [1, 2, 16, 4096])
def test_full_size_is_the_best_way_where_it_can_work(samples: int) -> None:
    found = looks(replace(ASKED, samples=samples))
    assert best(list(found.values())) is Way.FULL_SIZE
    assert max(d for look in found.values() if (d := look.decibels) is not None) == 0.0


def test_decibels_are_differences_at_the_samples_asked_for() -> None:
    found = looks()
    expected = {
        way: MODEL.errors.psnr(choice)
        for way in (Way.FULL_SIZE, Way.X2, Way.X4)
        if (choice := choice_of(way, ASKED))
    }
    first = found[Way.FULL_SIZE].decibels
    assert first is not None
    for way, psnr in expected.items():
        apart = psnr - expected[Way.FULL_SIZE]
        assert found[way].decibels == pytest.approx(first + apart, abs=1e-6)
    assert found[Way.X8].decibels < found[Way.X4].decibels < found[Way.X2].decibels < -1


def test_nothing_is_told_of_what_was_not_measured() -> None:
    few = looks(replace(ASKED, samples=4))
    assert few[Way.X8].decibels is None  # measured from 16 samples on
    quick = replace(ASKED, samples=4096, plain_denoiser=Denoiser.FAST_FAST)
    short = MODEL.errors.curves[budget.Choice(Denoiser.FAST_FAST, 0)]
    apart = looks(quick)[Way.PLAIN].decibels
    assert apart == pytest.approx(
        short.psnr[-1]
        - MODEL.errors.curves[budget.Choice(Denoiser.XRDS_HIGH, 0)].at(
            short.samples[-1]
        ),
        abs=0.01,
    )
    noisy = looks(replace(ASKED, plain_denoiser=None))
    assert noisy[Way.PLAIN].decibels is None


def test_without_any_denoiser_plain_is_taken() -> None:
    bare = replace(ALL, denoiser=False, cycles_denoiser=False)
    found = looks(replace(ASKED, plain_denoiser=None), bare)
    assert best(list(found.values())) is Way.PLAIN
    assert found[Way.X2].decibels is None  # measured with a denoised small picture


def test_guides_between_two_counts_promise_the_lower() -> None:
    five = looks(replace(ASKED, guide_samples=5))[Way.X2]
    assert five == looks(ASKED)[Way.X2]


DENOISE = 10.0 * MODEL.denoiser_speed[Denoiser.XRDS_HIGH]
FULL = {
    "sync": 1.0,
    "beauty": 32.0,
    "denoise": DENOISE,
    "write": 0.5,
    "total": 33.5 + DENOISE,
}


def test_nothing_is_known_before_the_first_render() -> None:
    assert Measured(PIXELS).seconds(Way.X2, ASKED, PIXELS, MODEL) is None
    assert {look.seconds for look in looks().values()} == {None}


def test_a_render_at_full_size_tells_of_all_ways() -> None:
    known = learn(None, Way.FULL_SIZE, ASKED, PIXELS, FULL, MODEL)
    assert known.beauty == 2.0
    assert known.denoise == pytest.approx(10.0, rel=0.01)

    def seconds(way: Way, asked: Asked = ASKED, pixels: int = PIXELS) -> float:
        return known.seconds(way, asked, pixels, MODEL)

    assert seconds(Way.FULL_SIZE) == pytest.approx(33.5 + DENOISE)
    assert seconds(Way.PLAIN) == pytest.approx(1.5 + 32 + 10, rel=0.01)
    more = seconds(Way.FULL_SIZE, replace(ASKED, samples=32))
    assert more == pytest.approx(65.5 + DENOISE, rel=0.01)
    guides = 4 * GUIDE_SHARE * 2.0
    assert seconds(Way.X2) > 1.5 + 8 + guides
    assert seconds(Way.X8) < seconds(Way.X4) < seconds(Way.X2) < seconds(Way.PLAIN)
    quarter = seconds(Way.FULL_SIZE, pixels=PIXELS // 4)
    assert quarter == pytest.approx((33.5 + DENOISE) / 4, rel=0.01)


def test_a_small_render_tells_nothing_of_a_large_one() -> None:
    known = learn(None, Way.FULL_SIZE, ASKED, PIXELS // 100, FULL, MODEL)
    assert known.seconds(Way.FULL_SIZE, ASKED, PIXELS // 30, MODEL) is not None
    assert known.seconds(Way.FULL_SIZE, ASKED, PIXELS, MODEL) is None
    assert known.costs(PIXELS, MODEL) is None


def test_guides_and_network_are_taken_from_their_own_render() -> None:
    small = {"sync": 1.0, "beauty": 8.0, "denoise": 1.5, "guides": 4.0, "network": 3.0}
    known = learn(None, Way.X2, ASKED, PIXELS, small, MODEL)
    assert (known.beauty, known.guide) == (2.0, 1.0)
    assert known.seconds(Way.X2, ASKED, PIXELS, MODEL) == pytest.approx(17.5)
    other = known.seconds(Way.X2, replace(ASKED, guide_samples=8), PIXELS, MODEL)
    assert other == pytest.approx(17.5 + 4.0, rel=0.05)


def test_plain_alone_does_not_tell_samples_from_denoising() -> None:
    plain = {"sync": 1.0, "beauty": 42.0}
    known = learn(None, Way.PLAIN, ASKED, PIXELS, plain, MODEL)
    assert known.seconds(Way.PLAIN, ASKED, PIXELS, MODEL) == 43.0
    assert known.seconds(Way.FULL_SIZE, ASKED, PIXELS, MODEL) is None
    after = learn(known, Way.FULL_SIZE, ASKED, PIXELS, FULL, MODEL)
    again = learn(after, Way.PLAIN, ASKED, PIXELS, plain, MODEL)
    assert again.beauty == pytest.approx(2.0, rel=0.01)


def test_layers_of_a_scene_add_up() -> None:
    from types import SimpleNamespace

    from xrds_blender.frame import history
    from xrds_blender.frame.job import Picture, RenderJob

    FILE.end()
    picture = Picture(None, None, seconds=FULL)
    job = RenderJob(1)
    for layer in ("fore", "back"):
        history.keep(history.Place("Scene", layer, PIXELS, 16, None), job, picture)
    render = SimpleNamespace(
        resolution_x=1920,
        resolution_y=1080,
        resolution_percentage=100,
        use_border=False,
    )
    layers = [SimpleNamespace(name=n, use=n != "off") for n in ("fore", "back", "off")]
    scene = SimpleNamespace(name="Scene", view_layers=layers, render=render)
    asked = history.asked_of(job, 16, None)
    one = history.seconds(scene, Way.FULL_SIZE, asked)
    assert one == pytest.approx(2 * (33.5 + DENOISE))
    assert history.last(scene).seconds["beauty"] == 64.0
    assert history.costs(scene) is None
    layers[1].use = False
    assert history.seconds(scene, Way.FULL_SIZE, asked) == pytest.approx(one / 2)
    layers[2].use = True  # never rendered
    assert history.seconds(scene, Way.FULL_SIZE, asked) is None
    FILE.end()
