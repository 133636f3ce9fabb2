"""Parts of the light go the way that the whole goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shots import World, camera, view

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.errors import PictureError


def in_parts(number: int, x: float, **parts: float) -> Frame:
    """A frame; each part has the given share of the light, and noise of its own."""
    world = World(card=(0.05 * number, 0.1))
    frame = view(number, camera(x), world, noise=0.3).frame
    light = frame.radiance
    assert light is not None
    return replace(frame, parts={k: light * np.float32(v) for k, v in parts.items()})


def shot(**parts: float) -> list[Stored]:
    return [store(in_parts(n, 0.2 * n, **parts)) for n in range(5)]


def gathered(frames: list[Stored]) -> Accumulated:
    return accumulate(frames[2], frames[:2] + frames[3:])


def test_parts_add_up_to_the_whole() -> None:
    found = gathered(shot(lamp=0.25, sky=0.75))
    assert list(found.parts) == ["lamp", "sky"]
    assert found.samples.mean() > 2.0
    light = found.radiance
    assert np.allclose(found.parts["lamp"] + found.parts["sky"], light, atol=2e-3)
    assert np.allclose(found.parts["lamp"], 0.25 * light, atol=2e-3)


def test_the_whole_is_the_same_with_and_without_parts() -> None:
    found, plain = gathered(shot(lamp=0.25, sky=0.75)), gathered(shot())
    assert plain.parts == {}
    assert np.array_equal(found.radiance, plain.radiance)
    assert np.array_equal(found.samples, plain.samples)


def test_a_frame_alone_has_its_own_parts_as_they_are_stored() -> None:
    frame = in_parts(0, 0.0, lamp=0.4)
    found = accumulate(store(frame), [])
    assert np.array_equal(found.parts["lamp"], frame.parts["lamp"].astype(np.float16))


def test_bad_pixels_of_a_part_are_dark_in_it_alone() -> None:
    frame = in_parts(0, 0.0, lamp=0.4, sky=0.6)
    bad = frame.parts["lamp"].copy()
    bad[5, 6] = np.nan, np.inf, -np.inf
    stored = store(replace(frame, parts={**frame.parts, "lamp": bad}))
    found = accumulate(stored, [])
    assert not found.parts["lamp"][5, 6].any()
    assert found.parts["sky"][5, 6].any()
    assert np.array_equal(found.radiance, accumulate(store(frame), []).radiance)


def test_frames_of_other_parts_are_refused() -> None:
    frames = shot(lamp=0.4)
    frames[1] = replace(frames[1], parts={"sky": None})
    with pytest.raises(PictureError, match="different passes"):
        gathered(frames)


def test_parts_have_the_size_of_the_frame() -> None:
    frame = in_parts(0, 0.0)
    with pytest.raises(PictureError, match=r"lamp of frame 0 has shape \(2, 2, 3\)"):
        replace(frame, parts={"lamp": np.zeros((2, 2, 3), np.float32)})


def test_parts_that_are_dark_take_no_memory() -> None:
    frames = shot(lamp=0.4, off=0.0)
    assert all(frame.parts["off"] is None for frame in frames)
    found = gathered(frames)
    assert list(found.parts) == ["lamp", "off"]
    assert not found.parts["off"].any()


def test_a_lamp_that_is_off_in_one_frame_is_lent_as_dark() -> None:
    lit, dark = in_parts(0, 0.0, lamp=0.4), in_parts(0, 0.0, lamp=0.0)
    one, two = store(replace(lit, number=1)), store(replace(dark, number=2))
    whole, none = (accumulate(one, [x]).parts["lamp"] for x in (one, two))
    share = 1.0 - 1.0 / accumulate(one, [two]).samples[..., None]
    assert share.mean() > 0.3
    assert np.allclose(none, whole * (1.0 - share), atol=1e-5)
