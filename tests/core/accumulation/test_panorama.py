"""Frames of equirectangular panoramas lend to each other by direction."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from panoramas import HEIGHT, WIDTH, camera, frame, rays

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.camera import Sphere
from xrds_core.accumulation.frame import store
from xrds_core.accumulation.reprojection import reproject, reprojection

HALF = Sphere((-pi / 2, pi / 2), (-pi / 4, pi / 3))


@pytest.mark.parametrize("sphere", [Sphere(), HALF])
@pytest.mark.parametrize(
    "move", [{"yaw": 0.3}, {"x": 0.3, "z": -0.2}, {"x": 0.2, "yaw": -3.0}]
)
def test_pixels_pass_to_where_the_other_sees_them(
    move: dict[str, float], sphere: Sphere
) -> None:
    here, there = camera(sphere=sphere), camera(**move, sphere=sphere)
    seen = frame(0, here)
    point = seen.depth[..., None] * rays(here)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    given = (each.ravel().astype(np.float32) for each in (x, y, 1 / seen.depth))
    across, down, near = reproject(reprojection(here, there), *given)
    away = point - np.linalg.inv(there.view)[:3, 3]
    far = np.linalg.norm(away, axis=-1)
    np.testing.assert_allclose(near, 1 / far.ravel(), rtol=1e-4)
    # the pixel found looks towards the point
    inside = (across > 0) & (across < WIDTH) & (down > 0) & (down < HEIGHT)
    assert inside.any()
    column, row = across[inside].astype(int), down[inside].astype(int)
    towards = (away / far[..., None]).reshape(-1, 3)[inside]
    cosine = (rays(there)[row, column] * towards).sum(-1)
    assert np.arccos(np.clip(cosine, -1, 1)).max() < 0.75 * 2 * pi / WIDTH


@pytest.mark.parametrize("move", [{"yaw": 0.4}, {"x": 0.1, "z": 0.1, "yaw": 0.1}])
def test_panoramas_lend_all_around(move: dict[str, float]) -> None:
    here, there = frame(0, camera(), 0.8), frame(1, camera(**move), 0.8)
    found = accumulate(store(here), [store(there)])
    assert found.samples.mean() > 1.7
    assert np.abs(found.albedo - here.albedo).mean() < 0.01
    assert np.abs(found.normal - here.normal).mean() < 0.02


def test_other_kinds_of_cameras_lend_nothing() -> None:
    here, there = frame(0, camera()), frame(1, camera())
    part = replace(there, camera=camera(sphere=HALF))
    assert accumulate(store(here), [store(part)]).frames == (0,)
