"""The modes side by side: what each needs, its decibels and its seconds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from xrds_blender.internals.lifetimes import FILE
from xrds_blender.planning import budget
from xrds_blender.planning.estimates import (
    GUIDE_SHARE,
    Capabilities,
    Estimate,
    Measured,
    SceneSettings,
    automatic,
    estimates,
    learn,
    missing,
    resolved,
)
from xrds_blender.planning.settings import (
    DEFAULT_DENOISING,
    MODES,
    Denoising,
    Mode,
    Network,
    Settings,
)

MODEL = budget.shipped()
NETWORKS = frozenset(Network("fast", scale) for scale in (2, 4, 8))
ALL = Capabilities(True, True, True, NETWORKS)
REQUESTED = Settings(samples=16)
SCENE = SceneSettings(64)
PIXELS = 1920 * 1080


def found(
    settings: Settings = REQUESTED,
    here: Capabilities = ALL,
    scene: SceneSettings = SCENE,
) -> dict[Mode, Estimate]:
    return {each.mode: each for each in estimates(settings, scene, here, MODEL)}


def in_mode(mode: Mode, **others: Any) -> Settings:
    return resolved(replace(REQUESTED, mode=mode, **others), SCENE)


def test_a_mode_is_that_of_its_scale() -> None:
    assert [Mode.of(mode.scale) for mode in MODES[:-1]] == list(MODES[:-1])


def test_what_cannot_work_is_left_out_and_named() -> None:
    no_torch = replace(ALL, torch=False)
    assert set(found(here=no_torch)) == {Mode.FULL_SIZE, Mode.CYCLES_ONLY}
    assert "PyTorch" in missing(in_mode(Mode.X2), no_torch)
    x2 = replace(ALL, networks=frozenset({Network("fast", 2)}))
    assert set(found(here=x2)) == {Mode.FULL_SIZE, Mode.X2, Mode.CYCLES_ONLY}
    assert "weights" in missing(in_mode(Mode.X4), x2)
    assert "Open Image Denoise" in missing(
        in_mode(Mode.FULL_SIZE), replace(ALL, denoiser=False)
    )


@pytest.mark.parametrize("samples", [1, 2, 16, 4096])
def test_full_size_is_the_best_mode_where_it_can_work(samples: int) -> None:
    each = found(replace(REQUESTED, samples=samples))
    assert automatic(ALL.denoiser) is Mode.FULL_SIZE
    assert max(d for e in each.values() if (d := e.decibels) is not None) == 0.0


def test_decibels_are_differences_at_the_samples_requested() -> None:
    each = found()
    default = {"denoising": DEFAULT_DENOISING}  # as networks were measured
    expected = {
        Mode.FULL_SIZE: MODEL.errors.psnr(in_mode(Mode.FULL_SIZE)),
        Mode.X2: MODEL.errors.psnr(in_mode(Mode.X2, **default)),
        Mode.X4: MODEL.errors.psnr(in_mode(Mode.X4, **default)),
    }
    first = each[Mode.FULL_SIZE].decibels
    assert first is not None
    for mode, psnr in expected.items():
        apart = psnr - expected[Mode.FULL_SIZE]
        assert each[mode].decibels == pytest.approx(first + apart, abs=1e-6)
    assert each[Mode.X8].decibels < each[Mode.X4].decibels < each[Mode.X2].decibels < -1


def test_nothing_is_said_of_what_was_not_measured() -> None:
    few = found(replace(REQUESTED, samples=4))
    assert few[Mode.X8].decibels is None  # measured from 16 samples on
    quick = SceneSettings(4096, Denoising.FAST_FAST)
    curves = MODEL.errors.curves
    short = curves[resolved(Settings(Mode.CYCLES_ONLY), quick).family]
    ours = curves[in_mode(Mode.FULL_SIZE).family].at(short.samples[-1])
    many = found(replace(REQUESTED, samples=4096), scene=quick)
    apart = many[Mode.CYCLES_ONLY].decibels
    assert apart == pytest.approx(short.psnr[-1] - ours, abs=0.01)
    noisy = found(scene=SceneSettings(16, None))
    assert noisy[Mode.CYCLES_ONLY].decibels is None


def test_without_any_denoiser_cycles_alone_is_taken() -> None:
    bare = replace(ALL, denoiser=False, cycles_denoiser=False)
    each = found(REQUESTED, bare, SceneSettings(16, None))
    assert automatic(bare.denoiser) is Mode.CYCLES_ONLY
    assert each[Mode.X2].decibels is None  # measured with a denoised small picture


def test_guides_between_two_counts_promise_the_lower() -> None:
    five = found(replace(REQUESTED, guide_samples=5))[Mode.X2]
    assert five == found(REQUESTED)[Mode.X2]


DENOISE = 10.0 * MODEL.denoiser_speed[Denoising.XRDS_HIGH]
FULL = {
    "sync": 1.0,
    "beauty": 32.0,
    "denoise": DENOISE,
    "write": 0.5,
    "total": 33.5 + DENOISE,
}


def test_nothing_is_known_before_the_first_render() -> None:
    assert Measured(PIXELS).seconds(in_mode(Mode.X2), PIXELS, MODEL) is None
    assert {each.seconds for each in found().values()} == {None}


def test_a_render_at_full_size_says_of_all_modes() -> None:
    known = learn(None, in_mode(Mode.FULL_SIZE), PIXELS, FULL, MODEL)
    assert known.beauty == 2.0
    assert known.denoise == pytest.approx(10.0, rel=0.01)

    def seconds(mode: Mode, pixels: int = PIXELS, **others: Any) -> float:
        return known.seconds(in_mode(mode, **others), pixels, MODEL)

    assert seconds(Mode.FULL_SIZE) == pytest.approx(33.5 + DENOISE)
    assert seconds(Mode.CYCLES_ONLY) == pytest.approx(1.5 + 32 + 10, rel=0.01)
    more = seconds(Mode.FULL_SIZE, samples=32)
    assert more == pytest.approx(65.5 + DENOISE, rel=0.01)
    guides = 4 * GUIDE_SHARE * 2.0
    assert seconds(Mode.X2) > 1.5 + 8 + guides
    assert (
        seconds(Mode.X8)
        < seconds(Mode.X4)
        < seconds(Mode.X2)
        < seconds(Mode.CYCLES_ONLY)
    )
    quarter = seconds(Mode.FULL_SIZE, pixels=PIXELS // 4)
    assert quarter == pytest.approx((33.5 + DENOISE) / 4, rel=0.01)


def test_a_small_render_says_nothing_of_a_large_one() -> None:
    known = learn(None, in_mode(Mode.FULL_SIZE), PIXELS // 100, FULL, MODEL)
    assert known.seconds(in_mode(Mode.FULL_SIZE), PIXELS // 30, MODEL) is not None
    assert known.seconds(in_mode(Mode.FULL_SIZE), PIXELS, MODEL) is None
    assert known.costs(PIXELS, MODEL) is None


def test_guides_and_network_are_taken_from_their_own_render() -> None:
    small = {"sync": 1.0, "beauty": 8.0, "denoise": 1.5, "guides": 4.0, "network": 3.0}
    known = learn(None, in_mode(Mode.X2), PIXELS, small, MODEL)
    assert (known.beauty, known.guide) == (2.0, 1.0)
    assert known.seconds(in_mode(Mode.X2), PIXELS, MODEL) == pytest.approx(17.5)
    other = known.seconds(in_mode(Mode.X2, guide_samples=8), PIXELS, MODEL)
    assert other == pytest.approx(17.5 + 4.0, rel=0.05)


def test_cycles_alone_reports_samples_and_denoising_as_one() -> None:
    plain = {"sync": 1.0, "beauty": 42.0}
    known = learn(None, in_mode(Mode.CYCLES_ONLY), PIXELS, plain, MODEL)
    assert known.seconds(in_mode(Mode.CYCLES_ONLY), PIXELS, MODEL) == 43.0
    assert known.seconds(in_mode(Mode.FULL_SIZE), PIXELS, MODEL) is None
    after = learn(known, in_mode(Mode.FULL_SIZE), PIXELS, FULL, MODEL)
    again = learn(after, in_mode(Mode.CYCLES_ONLY), PIXELS, plain, MODEL)
    assert again.beauty == pytest.approx(2.0, rel=0.01)


def test_layers_of_a_scene_add_up() -> None:
    from types import SimpleNamespace

    from xrds_blender.rendering import history

    FILE.end()
    settings = in_mode(Mode.FULL_SIZE)
    for name in ("fore", "back"):
        history.remember(history.Layer("Scene", name, PIXELS, SCENE), settings, FULL)
    render = SimpleNamespace(
        resolution_x=1920,
        resolution_y=1080,
        resolution_percentage=100,
        use_border=False,
    )
    layers = [SimpleNamespace(name=n, use=n != "off") for n in ("fore", "back", "off")]
    scene = SimpleNamespace(name="Scene", view_layers=layers, render=render)
    one = history.seconds(scene, settings)
    assert one == pytest.approx(2 * (33.5 + DENOISE))
    assert history.last(scene).seconds["beauty"] == 64.0
    assert history.seconds(scene, settings, 4) > one  # and neighbours
    layers[1].use = False
    assert history.seconds(scene, settings) == pytest.approx(one / 2)
    layers[2].use = True  # never rendered
    assert history.seconds(scene, settings) is None
    FILE.end()
