"""Neighbours that show something else, found by the noise of a frame's samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import camera

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import Frame, Halves, Stored, pack_frame, store
from xrds_core.accumulation.local_filters import box

Array = NDArray[np.float32]
SHAPE = (48, 64)
SAMPLES = 16.0
PLAIN = np.full((*SHAPE, 3), 0.5, np.float32)
SPOTS = np.random.default_rng(7).choice(np.float32([0.2, 0.8]), (*SHAPE, 1))
SPOTS = np.repeat(SPOTS, 3, axis=-1)
OTHER_SPOTS = np.ascontiguousarray(SPOTS[:, ::-1])


def frame(number: int, light: Array, albedo: Array, noise: float = 0.2) -> Frame:
    """A frame under a camera that stands still: a wall, light times albedo."""
    rng = np.random.default_rng(number)

    def halves(truth: Array, spread: float) -> Array:
        grain = rng.standard_normal((2, *truth.shape)) * spread * 2**0.5
        return (truth + grain).astype(np.float32)

    normal = np.broadcast_to(np.float32([0, 0, 1]), PLAIN.shape)
    radiance = halves(light * albedo, noise)
    guides = halves(albedo, 0.02), halves(normal, 0.01)
    return Frame(
        number=number,
        camera=camera(),
        radiance=radiance.mean(axis=0),
        albedo=guides[0].mean(axis=0),
        normal=guides[1].mean(axis=0),
        depth=np.full(SHAPE, 5.0, np.float32),
        samples=SAMPLES,
        halves=Halves(radiance),
    )


def shot(light: Array, albedo: Array, others: tuple[Array, Array]) -> list[Stored]:
    """Five frames; all but the middle one show `others`, light and albedo."""
    return [
        store(frame(n, *((light, albedo) if n == 3 else others))) for n in range(1, 6)
    ]


def accumulated(frames: list[Stored]) -> tuple[Array, Array]:
    """The radiance of the middle frame and its samples, in those of one frame."""
    result = accumulate(frames[2], frames[:2] + frames[3:])
    assert result.radiance is not None
    return result.radiance, result.samples / SAMPLES


def error(picture: Array, truth: Array) -> float:
    return float(np.mean(np.square(picture - truth, dtype=np.float64)))


def stored(kept: bool, number: int, light: Array, albedo: Array) -> Stored:
    """A frame whose halves are `kept`, or not."""
    found = frame(number, light, albedo, 0.05)
    return store(found if kept else replace(found, halves=None))


def test_neighbours_that_agree_all_count() -> None:
    _, samples = accumulated(shot(PLAIN, SPOTS, (PLAIN, SPOTS)))
    assert samples.mean() > 4.1  # halves are taken for parts of one sequence


def test_without_halves_neighbours_that_agree_count_as_well() -> None:
    _, samples = accumulated([stored(False, n, PLAIN, SPOTS) for n in range(1, 6)])
    assert samples.mean() > 4.1


@pytest.mark.parametrize("kept", [True, False])
def test_a_pattern_that_differs_is_seen_though_its_mean_is_the_same(kept: bool) -> None:
    truth, other = PLAIN * SPOTS, OTHER_SPOTS
    seen = (other, other, SPOTS, other, other)
    frames = [stored(kept, n, PLAIN, x) for n, x in enumerate(seen)]
    judged, samples = accumulated(frames)
    assert samples.mean() < 1.1
    alone = frames[2].picture[:, :3].reshape(truth.shape)
    assert error(judged, truth) < 1.05 * error(alone, truth)


def test_a_pattern_of_light_alone_is_seen_by_halves_alone() -> None:
    """As fine as pixels, in a mirror: to the pixels around it is the frame's noise."""
    seen = (OTHER_SPOTS, OTHER_SPOTS, SPOTS, OTHER_SPOTS, OTHER_SPOTS)
    lent = {
        kept: accumulated([stored(kept, n, x, PLAIN) for n, x in enumerate(seen)])[
            1
        ].mean()
        for kept in (True, False)
    }
    assert lent[True] < 1.7
    assert lent[False] > 4.0  # what docs/guide.md says of such frames


@pytest.mark.parametrize("kept", [True, False])
def test_a_shadow_that_guides_do_not_show_lends_nothing(kept: bool) -> None:
    shadow = PLAIN.copy()
    shadow[:, 32:] *= 0.3
    lights = (PLAIN, PLAIN, shadow, PLAIN, PLAIN)
    frames = [stored(kept, n, x, PLAIN) for n, x in enumerate(lights)]
    _, samples = accumulated(frames)
    assert samples[:, 40:].mean() < 1.1


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_guides_alone_lend_where_they_are_alike(noise: float) -> None:
    def guides(number: int, albedo: Array) -> Stored:
        rng = np.random.default_rng(number)
        grain = noise * rng.standard_normal(albedo.shape).astype(np.float32)
        found = frame(number, PLAIN, albedo + grain)
        return store(replace(found, radiance=None, halves=None))

    for other, least, most in ((PLAIN, 4.0, 5.01), (OTHER_SPOTS, 1.0, 1.5)):
        seen = (other, other, PLAIN, other, other)
        own, *others = [guides(2, PLAIN)] + [
            guides(n, x) for n, x in enumerate(seen) if n != 2
        ]
        samples = accumulate(own, others).samples / SAMPLES
        assert least <= samples.mean() < most


def test_one_wrong_neighbour_far_away_spoils_no_near_ones() -> None:
    right, wrong = (PLAIN, SPOTS), (PLAIN, OTHER_SPOTS)
    frames = [store(frame(n, *(wrong if n in (1, 5) else right))) for n in range(1, 6)]
    _, samples = accumulated(frames)
    assert 2.5 < samples.mean() < 3.1


def test_a_shadow_that_moves_on_stays_in_its_frame() -> None:
    """No frame by itself shows it for all its noise; the neighbours together do."""

    def shaded(number: int) -> Array:
        light = PLAIN.copy()
        light[:, 8 + 6 * number : 14 + 6 * number] *= 0.4
        return light

    frames = [store(frame(n, shaded(n), SPOTS, 0.1)) for n in range(1, 9)]
    still = [store(frame(n, PLAIN, SPOTS, 0.1)) for n in range(1, 9)]
    both = []
    for shown in (frames, still):
        result = accumulate(shown[3], shown[:3] + shown[4:])
        both.append((result.samples / SAMPLES)[:, 20:60].mean())
    moving, unmoved = both
    assert moving < 0.4 * unmoved


def test_a_pixel_without_samples_takes_those_of_neighbours() -> None:
    frames = [frame(n, PLAIN, SPOTS) for n in range(1, 6)]
    frames[2].radiance[20, 30] = np.nan
    picture, samples = accumulated([store(x) for x in frames])
    assert np.isfinite(picture).all()
    assert samples[20, 30] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 3e38, -1e6])
def test_noise_is_finite_whatever_the_halves_hold(bad: float) -> None:
    noisy = frame(1, PLAIN, SPOTS)
    assert noisy.halves is not None
    noisy.halves.radiance[0, 3, 4] = bad
    noisy.albedo[5, 6] = bad
    with np.errstate(all="raise"):
        noise = pack_frame(noisy)[2]
    assert noise is not None
    for array in (noise.brightness, noise.difference, noise.guides):
        assert np.isfinite(array).all()


def test_box_is_a_mean() -> None:
    x = np.random.default_rng(0).standard_normal((20, 30)).astype(np.float32)
    for size in (1, 3, 5, 7):
        half = size // 2
        expected = x[8 - half : 9 + half, 9 - half : 10 + half].mean()
        assert box(x, size)[8, 9] == pytest.approx(expected, abs=1e-6)


def test_pixels_that_hold_nan_are_no_noise() -> None:
    """An infinite half would make all noise around it, and any neighbour right."""
    spoilt = frame(1, PLAIN, SPOTS)
    assert spoilt.halves is not None
    for array in (spoilt.halves.radiance[1], spoilt.radiance):
        array[20, 30] = np.inf
    stored, pixel = store(spoilt), 20 * SHAPE[1] + 30
    assert stored.noise is not None
    assert stored.noise.brightness[pixel] == stored.noise.difference[pixel] == 0.0
