"""Cuts that cameras tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shots import FOCUS, HEIGHT, WIDTH, World, camera, view

from xrds_core.accumulation.accumulate import accumulate, same_shot
from xrds_core.accumulation.camera import Camera, is_shot_cut
from xrds_core.accumulation.frame import store


def zoomed(factor: float) -> Camera:
    eye = camera()
    return replace(eye, project=np.diag([factor, factor, 1.0, 1.0]) @ eye.project)


@pytest.mark.parametrize(
    "after",
    [
        replace(camera(), name="other"),
        camera(orthographic=True),
        replace(camera(), size=(2 * WIDTH, 2 * HEIGHT)),
        zoomed(2.0),
        zoomed(0.5),
        camera(yaw=1.0),
    ],
)
def test_what_is_a_cut(after: Camera) -> None:
    assert is_shot_cut(camera(), after)
    assert is_shot_cut(after, camera())


@pytest.mark.parametrize(
    "after",
    [
        camera(),
        camera(x=0.5, z=-0.5),
        camera(yaw=0.3 / FOCUS),
        camera(window=(8, 0)),
        zoomed(1.1),
    ],
)
def test_what_is_none(after: Camera) -> None:
    assert not is_shot_cut(camera(), after)


def test_a_take_ends_at_the_first_cut_on_either_side() -> None:
    eyes = {n: camera() for n in range(1, 8)}
    eyes |= {n: replace(camera(), name="B") for n in (3, 4, 5)}
    frames = {n: store(view(n, eye).frame) for n, eye in eyes.items()}

    def numbers(target: int) -> list[int]:
        others = [frame for n, frame in frames.items() if n != target]
        return [frame.number for frame in same_shot(frames[target], others)]

    assert numbers(4) == [3, 5]
    assert numbers(1) == [2]  # and not 6 and 7, of the same camera
    assert numbers(7) == [6]


def test_after_a_cut_nothing_of_the_old_camera_stays() -> None:
    """Though both cameras see one wall in one light, to the pixel."""
    before = store(view(1, camera(), World(light=1.0)).frame)
    after = store(view(2, replace(camera(), name="B"), World(light=1.0)).frame)
    ghost = accumulate(after, [before])
    assert np.array_equal(ghost.radiance, accumulate(after, []).radiance)
    assert (ghost.samples == after.samples).all()
    assert ghost.frames == (2,)
    assert accumulate(after, [replace(before, camera=after.camera)]).frames == (1, 2)
