"""What mirrors and glass show is found by where its image lies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import World, camera, view

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame, store

Array = NDArray[np.float32]
MIRROR = (0.0, 0.0)  # where its middle is, half as far away as what it shows
STEP = 0.23  # of the camera, in no whole number of pixels


def mirrored(number: int, eye: Camera) -> Frame:
    """A mirror before a wall, which shows one just as far behind it as the wall is."""
    shown = view(number, eye, World(wall_half=90.0), noise=0.4).frame
    depth = view(number, eye, World(card=MIRROR, card_half=1.6)).frame.depth
    length = shown.depth / eye.depth_per_length(shown.shape)
    return replace(shown, depth=depth, path_length=length, samples=4.0)


def mirror(frame: Frame) -> NDArray[np.bool_]:
    """Pixels of the mirror, without those at its edge."""
    inside = frame.depth < 7.0
    rows, columns = (np.flatnonzero(inside.any(axis=i)) for i in (1, 0))
    result = np.zeros(inside.shape, bool)
    result[rows[3] : rows[-3], columns[3] : columns[-3]] = True
    return result


def shot(
    change: Callable[[Frame], Frame] = lambda x: x, orthographic: bool = False
) -> tuple[Frame, Accumulated]:
    """The middle one of nine frames, and the same with its neighbours' samples."""
    eyes = [camera(STEP * k, orthographic=orthographic) for k in range(-4, 5)]
    frames = [change(mirrored(k, eye)) for k, eye in enumerate(eyes)]
    target, *others = (store(x) for x in (frames[4], *frames[:4], *frames[5:]))
    return frames[4], accumulate(target, others)


def without_path(frame: Frame) -> Frame:
    return replace(frame, path_length=None)


def reused(found: Accumulated, where: NDArray[np.bool_]) -> float:
    """Samples for each of the frame's own."""
    return float(np.mean(found.samples[where])) / 4.0


def error(found: Accumulated, frame: Frame, where: NDArray[np.bool_]) -> float:
    assert found.radiance is not None
    return float(np.mean(np.square(found.radiance - frame.albedo)[where]))


def test_what_a_mirror_shows_is_found_by_its_image() -> None:
    frame, found = shot()
    inside = mirror(frame)
    assert inside.sum() > 150
    _, surface = shot(without_path)
    assert reused(found, inside) > 4.0
    assert reused(surface, inside) < 2.0
    alone = float(np.mean(np.square(frame.radiance - frame.albedo)[inside]))
    assert error(found, frame, inside) < 0.4 * alone
    assert error(found, frame, inside) < 0.6 * error(surface, frame, inside)


def test_what_is_no_mirror_is_reused_as_before() -> None:
    frame, found = shot()
    _, surface = shot(without_path)
    outside = np.ones(frame.shape, bool)
    rows, columns = (np.flatnonzero((frame.depth < 7.0).any(axis=i)) for i in (1, 0))
    outside[rows[0] - 8 : rows[-1] + 9, columns[0] - 8 : columns[-1] + 9] = False
    assert outside.sum() > 500
    assert reused(found, outside) >= reused(surface, outside)
    assert error(found, frame, outside) <= 1.02 * error(surface, frame, outside)


def test_paths_that_are_a_little_short_find_it_too() -> None:
    """As their parts are weighted by what the mirror reflects."""
    frame, found = shot(lambda x: replace(x, path_length=0.96 * x.path_length))
    assert reused(found, mirror(frame)) > 3.5


def test_an_orthographic_camera_shows_images_where_they_are() -> None:
    frame, found = shot(orthographic=True)
    inside = mirror(frame)
    assert inside.sum() > 50
    assert reused(found, inside) > 4.0


def test_an_image_that_moves_by_itself_is_searched() -> None:
    """As in a curved mirror: it lies elsewhere than the path says."""

    def moved(frame: Frame) -> Frame:
        shift = 1.0 * (frame.number - 4)  # pixels
        eye = camera(STEP * (frame.number - 4))
        project = eye.project.copy()
        project[0, 2] += 2 * shift / eye.size[0]
        other = mirrored(frame.number, replace(eye, project=project))
        inside = (frame.depth < 7.0)[..., None]
        return replace(
            frame,
            radiance=np.where(inside, other.radiance, frame.radiance),
            albedo=np.where(inside, other.albedo, frame.albedo),
        )

    frame, found = shot(moved)
    _, surface = shot(lambda x: without_path(moved(x)))
    inside = mirror(frame)
    assert reused(found, inside) > reused(surface, inside) + 1.0
    assert error(found, frame, inside) < error(surface, frame, inside)


@pytest.mark.parametrize(
    "length", [0.0, -3.0, np.inf, -np.inf, np.nan, 1e-30, 1e30, 5.0]
)
def test_lengths_that_say_nothing_change_nothing(length: float) -> None:
    """Sky in a mirror, files of other renderers, and depth in place of the path's."""

    def spoil(frame: Frame) -> Frame:
        return replace(frame, path_length=np.full_like(frame.depth, length))

    _, found = shot(spoil)
    _, surface = shot(without_path)
    assert np.array_equal(found.radiance, surface.radiance)
    assert np.isfinite(found.radiance).all()


def test_lengths_that_are_wrong_are_not_believed() -> None:
    frame, found = shot(lambda x: replace(x, path_length=3.0 * x.path_length))
    inside = mirror(frame)
    alone = float(np.mean(np.square(frame.radiance - frame.albedo)[inside]))
    assert error(found, frame, inside) <= 1.05 * alone


def test_a_mirror_may_fill_the_picture() -> None:
    def fill(frame: Frame) -> Frame:
        return replace(frame, depth=np.full_like(frame.depth, 5.0))

    _, found = shot(fill)
    middle = np.s_[8:-8, 12:-12]
    assert float(np.mean(found.samples[middle])) / 4.0 > 4.0


def test_threads_change_nothing() -> None:
    eyes = [camera(STEP * k) for k in range(3)]
    target, *others = (store(mirrored(k, eye)) for k, eye in enumerate(eyes))
    one, two = (accumulate(target, others, threads=n) for n in (1, 3))
    assert np.array_equal(one.radiance, two.radiance)


def test_a_neighbour_without_paths_is_followed() -> None:
    """It is the frame's own paths that count."""
    frames = [mirrored(k, camera(STEP * (k - 1))) for k in range(3)]
    plain = [replace(x, path_length=None) for x in frames]
    whole = accumulate(store(frames[1]), [store(x) for x in (frames[0], frames[2])])
    part = accumulate(store(frames[1]), [store(x) for x in (plain[0], plain[2])])
    assert np.array_equal(whole.radiance, part.radiance)
