"""The offset of the nearest pixel is taken out, and nothing else is changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shots import HEIGHT, PIXEL, WIDTH, View, World, camera, view
from specification.registration import changes, moments

from xrds_core.accumulation import accumulate as module
from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import Frame, store

SAMPLES = 64.0
STEP = 10 * PIXEL  # of the camera, in a frame: a pixel of the wall
MIDDLE = np.s_[6:-6, 14:-14]  # what all frames show


def shot(step: float = 0.37 * STEP, **more: Any) -> list[View]:
    world = more.pop("world", World())
    more = {"noise": 0.05, "samples": SAMPLES} | more
    return [view(k, camera(x=step * k), world, **more) for k in range(-4, 5)]


def gathered(views: list[View], change: Callable[[Frame], Frame] = lambda x: x) -> Any:
    frames = [store(change(x.frame)) for x in views]
    return accumulate(frames[4], frames[:4] + frames[5:])


def unregistered(monkeypatch: pytest.MonkeyPatch, *given: Any) -> Accumulated:
    with monkeypatch.context() as patch:
        patch.setattr(module.Work, "guess", lambda *_: None)
        return gathered(*given)


def error(found: Accumulated, views: list[View], name: str = "radiance") -> float:
    apart = getattr(found, name) - views[4].colour
    return float(np.square(apart[MIDDLE]).mean())


def test_a_polynomial_of_second_degree_is_taken_out_exactly() -> None:
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:9, :12].astype(np.float32) / 8

    def polynomial(x: Any, y: Any) -> Any:
        return np.stack([1 + x - 2 * y + x * x + x * y / 2 - y * y, 3 * y, x * y], -1)

    off = rng.uniform(-0.5, 0.5, (3, 2, 9, 12)).astype(np.float32)
    weight = rng.uniform(0, 4, (3, 9, 12)).astype(np.float32)
    told = sum(
        moments(*d.reshape(2, -1), w.ravel()) for d, w in zip(off, weight, strict=True)
    )
    found = changes(np.moveaxis(polynomial(x, y), -1, 0), told)
    apart = [polynomial(x + d[0] / 8, y + d[1] / 8) - polynomial(x, y) for d in off]
    expected = sum(w[..., None] * a for w, a in zip(weight, apart, strict=True))
    inner = np.s_[2:-2, 2:-2]
    assert found.T.reshape(9, 12, 3)[inner] == pytest.approx(expected[inner], abs=0.01)


@pytest.mark.parametrize("step", [0.25, 0.5, 1.37])
def test_fine_texture_stays(step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    views = shot(step * STEP, world=World(wall_z=-40.0))  # four times as fine
    alone = error(accumulate(store(views[4].frame), ()), views)
    found, before = gathered(views), unregistered(monkeypatch, views)
    assert error(found, views, "albedo") < 0.6 * error(before, views, "albedo")
    assert error(found, views) < 0.8 * error(before, views)  # noise, as well
    assert found.samples.mean() > 1.25 * before.samples.mean()
    assert error(found, views) < 0.5 * alone


@pytest.mark.parametrize("samples", [1.0, 2.0])
def test_few_samples_are_gathered_as_they_are(
    samples: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = shot(samples=samples)
    np.testing.assert_array_equal(
        gathered(views).radiance, unregistered(monkeypatch, views).radiance
    )


def test_whole_pixels_leave_nothing_to_take_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    views = shot(STEP, noise=0.3)
    found, before = gathered(views), unregistered(monkeypatch, views)
    np.testing.assert_allclose(found.radiance, before.radiance, rtol=1e-3)


def test_an_even_picture_stays_even() -> None:
    def even(frame: Frame) -> Frame:
        light = np.full_like(frame.albedo, 0.75)
        return replace(frame, radiance=light, albedo=light)

    found = gathered(shot(), even)
    assert found.radiance == pytest.approx(np.full((HEIGHT, WIDTH, 3), 0.75), abs=1e-5)
    assert found.samples[MIDDLE].min() > 4 * SAMPLES


def test_parts_of_the_light_still_add_up() -> None:
    rng = np.random.default_rng(5)

    def with_parts(frame: Frame) -> Frame:
        assert frame.radiance is not None
        share = rng.uniform(0, 1, (HEIGHT, WIDTH, 1)).astype(np.float32)
        one = frame.radiance * share
        return replace(frame, parts={"one": one, "rest": frame.radiance - one})

    found = gathered(shot(), with_parts)
    total = found.parts["one"] + found.parts["rest"]
    np.testing.assert_allclose(total, found.radiance, atol=3e-3)


@pytest.mark.parametrize("apart", [1e-4, 1e-3, 4e-3])
def test_depth_that_jitters_adds_no_noise(
    apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As positions in float32 far from the origin do."""
    rng = np.random.default_rng(6)
    far = {}

    def jittered(frame: Frame) -> Frame:
        if frame.number not in far:
            far[frame.number] = rng.normal(1, apart, frame.shape).astype(np.float32)
        return replace(frame, depth=frame.depth * far[frame.number])

    views = shot(2.37 * STEP)
    found = gathered(views, jittered)
    before = unregistered(monkeypatch, views, jittered)
    assert error(found, views) < 1.05 * error(before, views)


def test_a_zoom_is_no_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    views = [
        view(k, camera(z=-0.4 * k), noise=0.05, samples=SAMPLES) for k in range(-4, 5)
    ]
    assert error(gathered(views), views) < error(
        unregistered(monkeypatch, views), views
    )


@pytest.mark.parametrize("name", ["radiance", "albedo", "normal"])
def test_what_is_unknown_does_not_spread(name: str) -> None:
    """In some frames, in all of them, and beside them."""

    def spoilt(frame: Frame) -> Frame:
        plane = getattr(frame, name).copy()
        plane[20:22, 20:22] = np.nan
        if frame.number % 2:
            plane[5, :] = np.inf
        return replace(frame, **{name: plane})

    views = shot(0.0, noise=0.0)
    frames = [spoilt(x.frame) for x in views]
    # the camera moves by less than a pixel, so that the hole stays one
    moved = [replace(x, camera=camera(x=0.05 * STEP * x.number)) for x in frames]
    stored = [store(x) for x in moved]
    found = accumulate(stored[4], stored[:4] + stored[5:])
    assert found.radiance is not None
    hole = np.zeros((HEIGHT, WIDTH), bool)
    hole[20:22, 20:22] = True
    assert np.isfinite(found.radiance[~hole]).all()
    assert np.abs(found.radiance[~hole]).max() < 1.2


def test_a_lamp_of_any_brightness_stays_finite() -> None:
    def lit(frame: Frame) -> Frame:
        assert frame.radiance is not None
        light = frame.radiance.copy()
        light[24, 32] = 1e6
        return replace(frame, radiance=light)

    assert np.isfinite(gathered(shot(), lit).radiance).all()


def test_a_lamp_has_no_dark_rim() -> None:
    """A bulb on a dark wall that all frames see, each with its own part of a pixel."""
    views = shot(noise=0.02)
    across = np.arange(WIDTH, dtype=np.float32)

    def lit(frame: Frame) -> Frame:
        centre = WIDTH / 2 - 0.37 * frame.number  # as the wall moves
        covered = np.clip(1.5 - np.abs(across - centre), 0, 1)
        light = np.full((HEIGHT, WIDTH, 3), 0.05, np.float32)
        light[22:26] += 500 * covered[:, None]
        even = np.full_like(frame.albedo, 0.5)
        return replace(frame, radiance=light, albedo=even)

    found = gathered(views, lit)
    assert found.radiance is not None
    assert found.samples[MIDDLE].mean() > 4 * SAMPLES
    assert found.radiance.min() > 0.04
