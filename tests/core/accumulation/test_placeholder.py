"""Frames of which nothing was rendered take from those beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shots import HEIGHT, WIDTH, World, camera, view

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import store
from xrds_core.accumulation.reprojection import reprojected_placeholder
from xrds_core.shot import Shot

CARD = World(card=(0.3, 0.1))


@pytest.mark.parametrize("orthographic", [False, True])
def test_it_knows_where_its_pixels_lie(orthographic: bool) -> None:
    eyes = [camera(x=0.3 * k, orthographic=orthographic) for k in range(3)]
    frames = [store(view(k, eye, CARD).frame) for k, eye in enumerate(eyes)]
    found = reprojected_placeholder(1, eyes[1], [frames[0], frames[2]])
    assert found.is_empty
    assert np.isfinite(found.inverse_depth).mean() > 0.99
    close = np.isclose(found.inverse_depth, frames[1].inverse_depth, rtol=1e-3)
    assert close.mean() > 0.97  # all but the card's edges


@pytest.mark.parametrize("lit", [False, True])
def test_it_takes_what_the_others_show(lit: bool) -> None:
    eyes = [camera(x=0.2 * k) for k in range(3)]
    frames = [view(k, eye, CARD).frame for k, eye in enumerate(eyes)]
    guides = [store(x if lit else replace(x, radiance=None)) for x in frames]
    empty = reprojected_placeholder(1, eyes[1], [guides[0], guides[2]])
    found = accumulate(empty, [guides[0], guides[2]])
    assert found.samples.mean() > 1.3
    assert np.isfinite(found.albedo).mean() > 0.99
    assert np.nanmean(np.abs(found.albedo - frames[1].albedo)) < 0.03
    assert found.albedo.shape == (HEIGHT, WIDTH, 3)


def test_who_lies_between_two() -> None:
    shot = Shot(tuple(range(1, 10)), radius=2, cuts=frozenset({6}))
    assert [n for n in shot.order if shot.is_between(n)] == [2, 4, 8]
    assert not any(Shot((1, 2, 3), radius=0).is_between(n) for n in (1, 2, 3))
