"""How many samples are as good with neighbours as more without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import World, camera, view

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import Halves, Stored, store
from xrds_core.accumulation.local_filters import BLOCK
from xrds_core.accumulation.noise import Noise
from xrds_core.accumulation.passes import Passes
from xrds_core.pace.error import Rendered, gain, measure_errors
from xrds_core.pace.extra_samples import enriched, with_extra
from xrds_core.pace.worth import Errors

Array = NDArray[np.float32]
SHAPE = (192, 256)
WHOLE = slice(None), slice(None)
TOP = slice(0, BLOCK), slice(None)


def noisy(truth: Array, deviation: float, seed: int) -> Array:
    noise = np.random.default_rng(seed).normal(0.0, deviation, truth.shape)
    return np.asarray(truth + noise, np.float32)


def denoised(truth: Array, deviation: float, seed: int) -> Array:
    """What is left of noise is coarse: four pixels across."""
    height, width, channels = truth.shape
    error = noisy(np.zeros((height // 4, width // 4, channels), np.float32), 1.0, seed)
    return truth + np.float32(deviation) * error.repeat(4, 0).repeat(4, 1)


def errors(
    ours: float, theirs: float, noise: float = 0.3, alone: float = 0.0
) -> Errors:
    """Of pictures whose errors have these deviations; `theirs` of all samples."""
    truth = np.full((*SHAPE, 3), 0.5, np.float32)
    first, second = (
        Rendered(noisy(truth, noise, i), denoised(truth, theirs, i + 10))
        for i in (1, 2)
    )
    picture, own = denoised(truth, ours, 3), noisy(truth, noise * 1.4, 4)
    return measure_errors(
        picture, denoised(truth, alone or ours, 5), own, (first, second)
    )


@pytest.mark.parametrize("expected", [0.25, 1.0, 4.0])
def test_errors_are_measured_without_a_reference(expected: float) -> None:
    found = errors(0.05 * expected**0.5, 0.05)
    assert 0.8 * expected < found.ratio < 1.3 * expected + 0.1
    near, far = found.misfit(np.array([expected, 3.0 * expected]))
    assert abs(near) < 2.0 < abs(far)


def test_a_picture_as_good_as_that_of_all_samples_is_known_from_much_noise() -> None:
    """Noise counts in the difference of both errors little."""
    for noise in (0.1, 0.6):
        found = errors(0.05, 0.05, noise)
        assert found.ratio == pytest.approx(1.0, rel=0.15)
        assert abs(found.misfit(np.array([1.6]))[0]) > 2.0


def test_the_error_without_neighbours_is_measured_as_well() -> None:
    found = errors(0.05, 0.05, 0.2, alone=0.1)
    near, far = found.misfit_alone(np.array([4.0, 2.5]))
    assert abs(near) < 2.0 < abs(far)


def test_any_ratio_may_be_true_where_noise_hides_errors() -> None:
    found = errors(0.001, 0.001, noise=3.0)
    assert np.abs(found.misfit(np.array([0.2, 1.0, 5.0]))).max() < 2.5


def test_radiance_beyond_all_bounds_is_survived() -> None:
    truth = np.full((64, 64, 3), 0.5, np.float32)
    bad = truth.copy()
    bad[3, 4] = 3e38
    parts = Rendered(bad, truth), Rendered(-bad, truth)
    found = measure_errors(truth, truth, bad, parts)
    assert np.isfinite(found.misfit(np.array([0.1, 1.0, 10.0]))).all()


def frames(moved: bool = True) -> tuple[list, Accumulated]:
    """Three frames of a wall, the middle one with its neighbours."""
    found = [
        store(view(n, camera(0.3 * n if moved else 0.0), World(), noise=0.2).frame)
        for n in (1, 2, 3)
    ]
    return found, accumulate(found[1], [found[0], found[2]])


def test_what_neighbours_bring_is_counted() -> None:
    found, accumulated = frames(moved=False)
    gained = gain(accumulated, found[1])
    assert 2.0 < gained < 3.2
    half = gain(accumulated, found[1], 0.5)
    assert half == pytest.approx(1.0 + (gained - 1.0) / 2, abs=0.1)
    alone = gain(accumulate(found[1], []), found[1])
    assert alone == pytest.approx(1.0)


def test_more_of_the_same_is_of_no_use_where_neighbours_lend_nothing() -> None:
    found, accumulated = frames(moved=False)
    samples = accumulated.samples.copy()
    columns = samples.shape[1] // 2
    samples[:, :columns] = found[1].samples  # the left half is the frame's own alone
    accumulated = replace(accumulated, samples=samples)
    often = [gain(accumulated, found[1], x) for x in (1.0, 8.0, 1e6)]
    assert often[0] < often[1] < often[2] < 3.2, often  # half of the error stays


def test_noise_without_bounds_leaves_a_gain() -> None:
    found, accumulated = frames(moved=False)
    noise = found[1].noise
    assert noise is not None
    root, apart, guides = (
        x.astype(np.float32) for x in (noise.brightness, noise.difference, noise.guides)
    )
    apart[5] = np.inf
    own = replace(found[1], noise=Noise.of(root, apart, guides))
    assert 2.0 < gain(accumulated, own) < 3.2


def extra(samples: Array, value: float) -> Passes:
    light = np.full((*samples.shape, 3), value, np.float32)
    return Passes(
        radiance=light,
        albedo=light,
        normal=light,
        alpha=np.ones_like(samples),
        counts=samples,
    )


def test_extra_samples_count_by_their_number() -> None:
    found, accumulated = frames()
    samples = np.zeros(found[1].shape, np.float32)
    samples[:BLOCK] = 3.0
    alone = accumulate(found[1], [])
    result = with_extra(accumulated, alone, extra(samples[:BLOCK], 7.0), TOP)
    assert result.radiance is not None
    assert accumulated.radiance is not None
    share = 3.0 / (accumulated.samples[:BLOCK] + 3.0)
    before = accumulated.radiance[:BLOCK]
    expected = before + (7.0 - before) * share[..., None]
    assert np.allclose(result.radiance[:BLOCK], expected, atol=1e-5)
    assert np.array_equal(result.radiance[BLOCK:], accumulated.radiance[BLOCK:])
    assert np.array_equal(result.samples, accumulated.samples + samples)


def test_extra_samples_that_are_not_finite_are_left_out() -> None:
    found, accumulated = frames()
    samples = np.ones(accumulated.samples.shape, np.float32)
    more = extra(samples, 7.0)
    more.radiance[5, 6] = np.nan
    result = with_extra(accumulated, accumulate(found[1], []), more, WHOLE)
    assert result.radiance is not None
    assert accumulated.radiance is not None
    assert np.array_equal(result.radiance[5, 6], accumulated.radiance[5, 6])
    assert np.isfinite(result.radiance).all()


@pytest.mark.parametrize("worth", [0.0, 0.5])
def test_neighbours_count_by_their_worth_beside_extra_samples(worth: float) -> None:
    found, accumulated = frames(moved=False)
    alone = accumulate(found[1], [])
    more = extra(np.full(found[1].shape, 3.0, np.float32), 7.0)
    result = with_extra(accumulated, alone, more, WHOLE, worth)
    assert result.albedo is not None
    counts = 1.0, worth * (accumulated.samples - 1.0), 3.0
    beside = accumulated.samples[..., None]
    neighbours = (accumulated.albedo * beside - alone.albedo) / (beside - 1.0)
    parts = alone.albedo, neighbours, more.albedo
    expected = (
        sum(x * np.asarray(n)[..., None] for x, n in zip(parts, counts, strict=True))
        / (sum(counts)[..., None])
    )
    assert np.allclose(result.albedo, expected, atol=1e-4)


def test_extra_samples_are_the_frames_own_from_then_on() -> None:
    found, _ = frames()
    frame, samples = found[1], np.zeros(found[1].shape, np.float32)
    samples[:BLOCK] = 3.0
    more = enriched(frame, accumulate(frame, []), extra(samples[:BLOCK], 7.0), TOP)
    assert more.counts is not None
    counts = more.counts.reshape(frame.shape)
    assert (counts[:BLOCK] == 4.0).all()
    assert (counts[BLOCK:] == frame.samples).all()
    assert more.samples == pytest.approx(counts.mean())
    light, before = (x.picture[:, :3].reshape(*x.shape, 3) for x in (more, frame))
    assert np.allclose(light[:BLOCK], before[:BLOCK] / 4 + 7.0 * 3 / 4, atol=1e-2)
    assert np.array_equal(light[BLOCK:], before[BLOCK:])
    assert more.noise is not None
    assert frame.noise is not None
    assert np.array_equal(more.noise.difference, frame.noise.difference)
    assert np.allclose(more.noise.brightness, frame.noise.brightness, rtol=1e-6)
    whole = enriched(
        frame,
        accumulate(frame, []),
        extra(np.full(frame.shape, 3.0, np.float32), 7.0),
        WHOLE,
    )
    assert whole.counts is None
    assert whole.samples == 4.0


def test_a_frame_with_extra_samples_shows_the_light_of_its_neighbours() -> None:
    """Roots of a pixel's light are darker the noisier it is; its light is the same."""
    rng = np.random.default_rng(5)

    def stored(number: int, noise: int) -> Stored:
        """A frame whose halves have light of so many equal parts each."""
        frame = view(number, camera(0.05 * number), World()).frame
        size = 2, noise, *frame.depth.shape, 1
        found = (rng.exponential(size=size) ** 3 / 6).mean(axis=1)  # a few are bright
        light = (frame.radiance * found).astype(np.float32)
        both = Halves(light)
        mean = light.mean(axis=0)
        return store(replace(frame, radiance=mean, samples=4.0, halves=both))

    own, other, more = (stored(n, noise) for n, noise in ((1, 1), (2, 1), (2, 32)))
    alone = accumulate(more, [])
    assert alone.radiance is not None
    samples = np.full(own.shape, 64.0, np.float32)
    extra = Passes(
        radiance=alone.radiance,
        albedo=alone.albedo,
        normal=alone.normal,
        alpha=np.ones_like(samples),
        counts=samples,
    )
    rich = enriched(other, accumulate(other, []), extra, WHOLE)
    shares = [
        (accumulate(own, [x]).samples.mean() - own.samples) / x.samples
        for x in (other, rich)
    ]
    assert shares[1] == pytest.approx(shares[0], rel=0.05), shares
