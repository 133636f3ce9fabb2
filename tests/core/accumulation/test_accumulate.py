"""Samples of neighbouring frames on the pixels of one."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import HEIGHT, WIDTH, World, camera, view

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.accumulation.noise import brightness
from xrds_core.accumulation.weighted_sums import MARGIN
from xrds_core.errors import PictureError

Array = NDArray[np.float32]
PASSES = ("radiance", "albedo", "normal")


def still(count: int, noise: float = 0.0, light: float = 1.0) -> list[Stored]:
    world = World(card=(0.3, 0.1), light=light)
    frames = [view(k, camera(), world, noise).frame for k in range(count)]
    return [store(x) for x in frames]


def equal(one: Accumulated, two: Accumulated) -> bool:
    return all(np.array_equal(getattr(one, x), getattr(two, x)) for x in PASSES)


def mean_square(x: Array) -> float:
    return float(np.mean(np.square(x, dtype=np.float64)))


def test_radius_0_gives_the_frame_as_it_is_stored() -> None:
    frame = replace(view(0, camera(), noise=0.5).frame, samples=3.0)
    result = accumulate(store(frame), [])
    for name in PASSES:
        stored = getattr(frame, name).astype(np.float16)
        assert np.array_equal(getattr(result, name), stored)
    assert (result.samples == 3.0).all()
    assert result.alpha is None
    assert result.rejected == 0.0


def test_equal_still_frames_are_their_own_mean() -> None:
    target, *others = still(5)
    result = accumulate(target, others)
    assert result.radiance.reshape(-1, 3) == pytest.approx(
        target.picture[:, :3], rel=1e-6
    )
    assert result.samples == pytest.approx(5.0, rel=1e-4)
    assert result.rejected < 1e-4


def test_noise_falls_as_samples_say() -> None:
    stored = still(9, noise=0.3)
    truth = view(0, camera(), World(card=(0.3, 0.1))).colour
    result = accumulate(stored[4], stored[:4] + stored[5:])
    alone = mean_square(stored[4].picture[:, :3].reshape(truth.shape) - truth)
    assert 7.5 < alone / mean_square(result.radiance - truth) < 9.5
    assert result.rejected < 0.12


def test_sample_counts_are_weights() -> None:
    frame = view(0, camera(), noise=0.8).frame
    brighter = replace(frame, number=1, albedo=frame.albedo + 0.01, samples=6.0)
    result = accumulate(store(replace(frame, samples=2.0)), [store(brighter)])
    assert result.samples.mean() > 7.7
    assert result.samples.max() <= 8.0 + 1e-4
    lent = 1.0 - 2.0 / result.samples[..., None]
    assert result.albedo == pytest.approx(frame.albedo + 0.01 * lent, abs=5e-4)


def test_a_moving_camera_brings_samples_to_their_pixels() -> None:
    frames = [view(k, camera(x=0.21 * k), noise=0.8) for k in range(-3, 4)]
    here = frames.pop(3)
    result = accumulate(store(here.frame), [store(x.frame) for x in frames])
    middle = np.s_[4:-4, 12:-12]  # what all frames show
    alone = mean_square((here.frame.radiance - here.colour)[middle])
    # the texture is half a pixel off at most, and weights fall with the distance
    assert alone / mean_square((result.radiance - here.colour)[middle]) > 4.0
    assert np.abs(result.albedo - here.colour)[middle].max() < 0.06
    assert result.samples[middle].mean() > 5.0
    assert result.samples[middle].min() > 2.0


def test_normals_turn_with_the_camera() -> None:
    here, there = view(0, camera()), view(1, camera(yaw=0.3))
    assert np.abs(there.frame.normal - here.frame.normal).max() > 0.2
    other = replace(there.frame, samples=1e6)
    result = accumulate(store(here.frame), [store(other)])
    lent = result.samples > 2.0
    assert lent.any()
    assert result.normal[lent] == pytest.approx(here.frame.normal[lent], abs=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", PASSES)
def test_bad_samples_never_spread(bad: float, where: str) -> None:
    clean = accumulate(*split(still(3, noise=0.1)))
    for spoilt in range(3):
        frames = [
            view(k, camera(), World(card=(0.3, 0.1)), 0.1).frame for k in range(3)
        ]
        getattr(frames[spoilt], where)[20, 30, 1] = bad
        result = accumulate(*split([store(x) for x in frames]))
        for name in PASSES:
            assert np.isfinite(getattr(result, name)).all()
        far = np.ones((HEIGHT, WIDTH), bool)
        reach = MARGIN + 3  # and that of the noise
        far[max(20 - reach, 0) : 21 + reach, 30 - reach : 31 + reach] = False
        # the light of the whole frame has a say everywhere, but little
        np.testing.assert_allclose(result.radiance[far], clean.radiance[far], rtol=1e-4)
        assert result.samples[20, 30] < clean.samples[20, 30] - 0.4


def split(stored: list[Stored]) -> tuple[Stored, list[Stored]]:
    return stored[1], [stored[0], *stored[2:]]


def test_a_pixel_that_no_frame_knows_is_nan_alone() -> None:
    frame = view(0, camera()).frame
    frame.radiance[7, 9] = np.nan
    result = accumulate(store(frame), [])
    assert result.samples[7, 9] == 0.0
    assert np.isnan(result.radiance[7, 9]).all()
    assert np.isfinite(result.radiance).sum() == result.radiance.size - 3


def test_nothing_is_lent_across_a_change_of_place() -> None:
    target, other = still(1)[0], store(view(1, camera(), World(wall_z=-4.0)).frame)
    result = accumulate(target, [other])
    assert equal(result, accumulate(target, []))
    assert result.rejected == 1.0


def test_other_light_is_not_lent() -> None:
    target, *others = still(5, noise=0.3)
    others += still(5, noise=0.3, light=3.0)[1:]
    result = accumulate(target, others)
    truth = view(0, camera(), World(card=(0.3, 0.1))).colour
    assert np.median(result.samples) < 6.2
    assert mean_square(result.radiance - truth) < 0.35 * mean_square(
        target.picture[:, :3].reshape(truth.shape) - truth
    )


def test_a_shadow_stays_where_it_is() -> None:
    frames = [view(k, camera(), noise=0.3).frame for k in range(3)]
    frames[0].radiance[10:30, 20:40] *= 0.1
    frames[2].radiance[10:30, 20:40] *= 0.1
    target, others = split([store(x) for x in frames])
    result = accumulate(target, others)
    inner = np.s_[12:28, 22:38]
    ghost = np.abs(result.radiance - frames[1].radiance)[inner].mean()
    assert ghost < 0.03 * frames[1].radiance[inner].mean()


def test_rare_bright_samples_are_no_other_light() -> None:
    rng = np.random.default_rng(3)
    frames = []
    for k in range(9):
        frame = view(k, camera(), noise=0.8).frame
        fireflies = rng.random((HEIGHT, WIDTH, 1)) < 0.01
        light = (frame.radiance * (1 + 200 * fireflies)).astype(np.float32)
        frames.append(store(replace(frame, radiance=light)))
    result = accumulate(frames[4], frames[:4] + frames[5:])
    assert result.rejected < 0.2


def test_light_that_changes_a_little_everywhere_is_not_lent() -> None:
    # too little for 7x7 pixels of this noise
    frames = still(5, noise=0.8)
    dimmer = still(9, noise=0.8, light=0.8)[5:]
    result = accumulate(frames[4], dimmer)
    assert result.rejected > 0.5
    assert accumulate(frames[4], frames[:4]).rejected < 0.2


def test_other_sample_counts_are_no_other_light() -> None:
    # the mean root of noisy light is smaller than that of less noisy light
    frames = [view(k, camera(), noise=0.8).frame for k in range(17)]
    mean = np.mean([x.radiance for x in frames[1:]], axis=0).astype(np.float32)
    many = replace(frames[1], radiance=mean, samples=16.0)
    result = accumulate(store(frames[0]), [store(many)])
    assert result.rejected < 0.1


def test_where_geometry_fits_by_chance_a_cut_lends_nothing() -> None:
    # half a wall in the same place as before, all else elsewhere
    here = view(0, camera(), World(card=(0.0, 0.0), card_half=9.0, card_z=-9.0))
    there = view(1, camera(x=1.0), World(card=(-4.0, 0.0), card_z=-9.0, card_half=2.5))
    result = accumulate(store(here.frame), [store(there.frame)])
    assert result.rejected == 1.0


def test_alpha_is_gathered_and_must_be_in_all_frames() -> None:
    frames = [view(k, camera(), noise=0.8).frame for k in range(2)]
    ones = np.ones((HEIGHT, WIDTH), np.float32)
    pairs = zip(frames, (0.50, 0.5078125), strict=True)
    with_alpha = [store(replace(x, alpha=ones * a)) for x, a in pairs]
    result = accumulate(with_alpha[0], [with_alpha[1]])
    assert result.alpha is not None
    lent = 1.0 - 1.0 / result.samples
    assert result.alpha == pytest.approx(0.5 + 0.0078125 * lent, abs=1e-5)
    assert lent.mean() > 0.4
    with pytest.raises(PictureError, match="frame 1 and frame 0 hold different passes"):
        accumulate(with_alpha[0], [store(frames[1])])


def test_what_is_empty_stays_empty() -> None:
    alphas = np.zeros((2, HEIGHT, WIDTH), np.float32)
    alphas[0, :, 30:] = alphas[1] = 0.5
    here, there = (
        store(replace(view(k, camera(), noise=0.8).frame, alpha=a))
        for k, a in enumerate(alphas)
    )
    result = accumulate(here, [there])
    assert (result.alpha[:, :30] == 0.0).all()
    # nor does the pixel beside what is empty take any
    assert (result.samples[:, :31] == 1.0).all()
    assert (result.samples[:, 31:] > 1.0).all()
    assert result.samples[:, 34:].mean() > 1.8


def test_light_beyond_half_floats_never_overflows() -> None:
    frames = [view(k, camera(x=0.1 * k), noise=0.3).frame for k in range(3)]
    frames[0].radiance[0, 0] = 1e9
    found = accumulate(*split([store(x) for x in frames]))
    assert np.isfinite(found.radiance).all()
    assert found.radiance.max() <= 65504


def test_the_result_does_not_depend_on_threads() -> None:
    stored = [store(view(k, camera(x=0.2 * k), noise=0.3).frame) for k in range(3)]
    one, many = (accumulate(*split(stored), threads=n) for n in (1, 7))
    assert equal(one, many)
    assert np.array_equal(one.samples, many.samples)


def test_frames_of_other_sizes_may_lend() -> None:
    # resolution or border may change within a shot
    here = view(0, camera()).frame
    part = view(1, camera(window=(8, 8)), shape=(32, 40)).frame
    result = accumulate(store(here), [store(part)])
    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[8:40, 8:48] = True
    assert np.array_equal(result.samples > 1.5, inside)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"albedo": np.zeros((4, 4, 3), np.float32)}, "albedo of frame 0 has shape"),
        ({"depth": np.zeros((HEIGHT, WIDTH, 1), np.float32)}, "depth of frame 0"),
        ({"alpha": np.zeros((2, 2), np.float32)}, "alpha of frame 0 has shape"),
        ({"samples": 0.0}, "frame 0 has 0.0 samples per pixel"),
        ({"samples": float("nan")}, "frame 0 has nan samples per pixel"),
    ],
)
def test_frames_that_cannot_be_say_why(change: dict[str, object], message: str) -> None:
    frame: Frame = view(0, camera()).frame
    with pytest.raises(PictureError, match=message):
        replace(frame, **change)  # type: ignore[arg-type]


def test_the_memory_of_a_call_does_not_grow_with_the_window() -> None:
    stored = [store(view(k, camera()).frame) for k in range(9)]
    peaks = []
    for others in (stored[1:3], stored[1:]):  # near and far ones in both
        accumulate(stored[0], others, threads=1)
        tracemalloc.start()
        accumulate(stored[0], others, threads=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_brightness_bears_negative_light() -> None:
    assert brightness(np.array([[-1.0, -1.0, -1.0]], np.float32))[0] == 0.0
    assert brightness(np.ones((2, 3), np.float32)) == pytest.approx(1.0)


def test_where_nothing_moves_every_sample_counts() -> None:
    """Noise that makes other frames disagree, and no depth: nothing need be asked."""
    frames = [view(n, camera(), noise=3.0).frame for n in range(1, 6)]
    frames = [replace(f, depth=np.full_like(f.depth, np.nan)) for f in frames]
    asked = [store(f) for f in frames]
    still = [store(replace(f, still=True)) for f in frames]
    assert accumulate(asked[0], asked[1:]).samples.mean() < 2.0
    found = accumulate(still[0], still[1:])
    assert found.samples.mean() > 4.8
    mean = np.mean([f.radiance for f in frames], axis=0)
    full = found.samples > 4.999
    assert full.mean() > 0.25
    np.testing.assert_allclose(found.radiance[full], mean[full], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("is_part", [True, False])
def test_where_nothing_moves_another_border_lends_what_it_shows(is_part: bool) -> None:
    """It begins at the same pixel, so its camera is the same."""
    shapes = (HEIGHT, WIDTH), (32, 40)
    here, there = (
        store(replace(view(n, camera(), shape=shape).frame, still=True))
        for n, shape in enumerate(shapes if is_part else shapes[::-1])
    )
    inside = np.zeros(here.shape, bool)
    inside[:32, :40] = True
    assert np.array_equal(accumulate(here, [there]).samples > 1.5, inside)


def test_where_nothing_moves_bad_pixels_lend_nothing() -> None:
    frames = [replace(view(n, camera()).frame, still=True) for n in (1, 2, 3)]
    frames[1].radiance[3, 4] = np.nan
    first, *rest = map(store, frames)
    found = accumulate(first, rest)
    assert found.samples[3, 4] == 2.0
    assert np.isfinite(found.radiance).all()
