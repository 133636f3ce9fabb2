"""How much the samples of neighbour frames count, by pixel and by frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import camera, view

pytest.importorskip("mitsuba_oidn")

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.denoising import Denoiser
from xrds_core.denoising.light_passes import LightPart
from xrds_core.finish import Finished, finish_frame

SHAPE = (96, 128)
CAMERA = replace(camera(), size=SHAPE[::-1])
THING, FAR = (slice(10, 40), slice(20, 60)), (slice(56, 90), slice(20, 110))
DENOISER = Denoiser("fast", "cpu")


def frame(number: int, strength: NDArray[np.float32] | None = None) -> Frame:
    """One of a camera that stands still, of four samples."""
    noise = 0.2 if number else 0.0
    made = view(number, CAMERA, noise=noise, shape=SHAPE, samples=4, still=True).frame
    return replace(made, strength=strength)


def without_thing() -> NDArray[np.float32]:
    strength = np.ones(SHAPE, np.float32)
    strength[THING] = 0.0
    return strength


def finished(own: Frame, others: list[Stored], **how: Any) -> Finished:
    return finish_frame(store(own), others, DENOISER, Movement(), **how)


def neighbours() -> list[Stored]:
    return [store(frame(n)) for n in range(2, 6)]


def test_where_neighbours_do_not_count_the_frame_is_alone_to_the_bit() -> None:
    own = frame(1, without_thing())
    mixed, shared = finished(own, neighbours()), finished(frame(1), neighbours())
    alone = finished(own, [])
    np.testing.assert_array_equal(mixed.picture[THING], alone.picture[THING])
    assert (mixed.accumulated.samples[THING] == 4.0).all()
    assert mixed.accumulated.samples[FAR].mean() > 16.0
    errors = [
        np.square(made.picture - frame(0).radiance)[FAR].mean()
        for made in (mixed, alone)
    ]
    assert errors[0] < 0.8 * errors[1]
    np.testing.assert_allclose(mixed.picture[FAR], shared.picture[FAR], rtol=0.02)


def test_a_part_of_the_picture_is_exact_too() -> None:
    """As `xrds denoise --crop` asks for it."""
    region = slice(5, 80), slice(10, 100)
    inside = tuple(
        slice(thing.start - part.start, thing.stop - part.start)
        for thing, part in zip(THING, region, strict=True)
    )
    own = frame(1, without_thing())
    made, alone = (finished(own, x, region=region) for x in (neighbours(), []))
    np.testing.assert_array_equal(made.picture[inside], alone.picture[inside])


def test_a_frame_with_holes_is_alone_to_the_bit() -> None:
    """Not even its pixels without a sample take a neighbour's."""
    radiance = frame(1).radiance.copy()
    radiance[::7, ::7] = np.nan
    own = replace(frame(1, without_thing()), radiance=radiance)
    mixed, alone = (finished(own, x).picture for x in (neighbours(), []))
    np.testing.assert_array_equal(mixed[THING], alone[THING])


def test_parts_of_the_light_follow() -> None:
    part = LightPart("half", ("half.R", "half.G", "half.B"))
    own = frame(1, without_thing())
    own, *others = (
        replace(x, parts={"half": x.radiance / 2})
        for x in (own, *(frame(n) for n in (2, 3)))
    )
    stored = [store(other) for other in others]
    mixed, alone = (finished(own, x, light=[part]).parts for x in (stored, []))
    np.testing.assert_array_equal(mixed["half"][THING], alone["half"][THING])
    assert np.abs(mixed["half"] - alone["half"])[FAR].mean() > 1e-3


@pytest.mark.parametrize("by_pixel", [False, True])
def test_an_error_of_the_neighbours_counts_as_much_as_they_do(by_pixel: bool) -> None:
    brighter = [frame(n) for n in (2, 3)]
    others = [store(replace(x, radiance=x.radiance * 1.1)) for x in brighter]
    light, samples = [], []
    for strength in (0.0, 0.25, 0.5, 0.75, 1.0):
        plane = np.full(SHAPE, strength, np.float32) if by_pixel else None
        how = {} if by_pixel else {"strength": strength}
        made = accumulate(store(frame(1, plane)), others, **how)
        assert made.radiance is not None
        light.append(float(made.radiance[FAR].mean(dtype=np.float64)))
        samples.append(float(made.samples[FAR].mean()))
    steps = np.diff(light)
    np.testing.assert_allclose(steps, steps.mean(), rtol=1e-3)
    assert samples[0] == 4.0
    assert (np.diff(samples) > 0.0).all()
    assert (np.diff(samples, 2) > 0.0).all()  # their part in the mean is even


def test_the_frames_strength_is_a_factor() -> None:
    plane = np.full(SHAPE, 0.5, np.float32)
    one = accumulate(store(frame(1, plane)), neighbours(), strength=0.5)
    two = accumulate(store(frame(1)), neighbours(), strength=0.25)
    np.testing.assert_allclose(one.samples, two.samples, rtol=1e-6)


def test_a_strength_of_none_looks_at_no_neighbour() -> None:
    alone, none = finished(frame(1), []), np.zeros(SHAPE, np.float32)
    for made in (
        finished(frame(1), neighbours(), strength=0.0),
        finished(frame(1, none), neighbours()),
    ):
        np.testing.assert_array_equal(made.picture, alone.picture)
        assert made.accumulated.frames == (1,)


def test_strengths_that_are_no_numbers() -> None:
    strength = np.full(SHAPE, np.nan, np.float32)
    strength[0, :3] = -1.0, 7.0, np.inf
    stored = store(frame(1, strength)).strengths()
    assert stored[0, :3].tolist() == [0.0, 1.0, 1.0]
    assert (stored.ravel()[3:] == 1.0).all()
