"""Depths of another kind than the cameras' are told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shots
from sequences import frame, single

from xrds_core.accumulation.frame import Frame, store
from xrds_core.shot_files.depth_kind import DepthKind

Change = Callable[[Frame], Any]


def turned(number: int, step: float = 0.3) -> Frame:
    """A frame of a wall that is seen at an angle, as the camera moves along."""
    eye = single(shots.camera(x=step * number, yaw=0.3))
    return shots.view(number, eye, noise=0.5).frame


def ray(own: Frame) -> Any:
    """How much longer the ray is than the depth."""
    rows, columns = np.mgrid[: shots.HEIGHT, : shots.WIDTH] + 0.5
    across = (2 * columns / shots.WIDTH - 1) / own.camera.project[0, 0]
    down = (2 * rows / shots.HEIGHT - 1) / own.camera.project[1, 1]
    return np.sqrt(1 + across**2 + down**2)


def told(change: Change, make: Callable[[int], Frame] = turned) -> list[str]:
    said: list[str] = []
    kind = DepthKind(said.append)
    frames = [make(n) for n in (1, 2, 3)]
    stored = [store(replace(x, depth=np.float32(1.0) * change(x))) for x in frames]
    for own in stored:
        kind.look(own, [x for x in stored if x is not own])
    return said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: x.depth * ray(x), "length of the ray"),
        (lambda x: 100 * x.depth * ray(x), "length of the ray"),
        (lambda x: 1 / x.depth, "1 / depth"),
        (lambda x: 1 - x.depth / 60, "the normals"),
        (lambda x: (x.depth - 4) / 30, "does not fit the normals"),
        (lambda x: 100 * x.depth, "multiplied by about 0.01"),
        (lambda x: 1000 * x.depth, "multiplied by about 0.001"),
        (lambda x: x.depth / 100, "multiplied by about 100"),
        (lambda x: x.depth / 0.0254, "multiplied by about 0.02"),
    ],
)
def test_another_kind_of_depth_is_told_once(change: Change, words: str) -> None:
    (line,) = told(change)
    assert words in line


@pytest.mark.parametrize(
    ("change", "make"),
    [
        (lambda x: x.depth, turned),
        (lambda x: x.depth, frame),
        (lambda x: x.depth, lambda n: frame(n, step=0.0)),
        (lambda x: 100 * x.depth, lambda n: turned(n, 0.0)),  # a camera that rests
        (lambda x: np.full_like(x.depth, np.inf), turned),
    ],
)
def test_what_fits_or_says_nothing_is_not_told(change: Change, make: Any) -> None:
    assert not told(change, make)
