"""The first look at a neighbour."""

from __future__ import annotations

import numpy as np
import pytest
from shots import HEIGHT, WIDTH, World, camera, view
from specification.summing import tile_shares

from xrds_core.accumulation.coarse_rejection import tile_weights
from xrds_core.accumulation.frame import store
from xrds_core.accumulation.reprojection import pair
from xrds_core.accumulation.weighted_sums import TILE


def test_like_frames_lend_all() -> None:
    frames = [store(view(k, camera(x=0.2 * k), noise=0.3).frame) for k in range(2)]
    assert tile_weights(pair(*frames)) == pytest.approx(1.0, abs=0.05)


def test_a_little_less_light_is_found_in_much_noise() -> None:
    here = store(view(0, camera(), noise=0.4).frame)
    there = store(view(1, camera(), World(light=0.85), noise=0.4).frame)
    assert tile_weights(pair(here, there)).max() < 0.2


def test_a_difference_that_no_one_sees_is_borne() -> None:
    here = store(view(0, camera()).frame)
    there = store(view(1, camera(), World(light=0.995)).frame)
    assert tile_weights(pair(here, there)).min() > 0.9


def test_a_cut_lends_nothing() -> None:
    here = store(view(0, camera()).frame)
    there = store(view(1, camera(), World(wall_z=-6.0)).frame)
    assert not tile_weights(pair(here, there)).any()


def test_a_sky_in_both_does_not_hide_a_cut() -> None:
    # the wall fills less than a third; the sky around it is the same in every view
    world, other = World(wall_half=2.0), World(wall_half=2.0, wall_z=-6.0)
    here, there = view(0, camera(), world), view(1, camera(), other)
    assert (here.name == 0).mean() > 0.6
    assert not tile_weights(pair(store(here.frame), store(there.frame))).any()
    nothing = World(wall_half=0.0)
    skies = [store(view(k, camera(), nothing).frame) for k in range(2)]
    assert tile_weights(pair(*skies)).min() == 1.0


def test_weights_are_linear_between_tiles() -> None:
    tiles = np.array([[0.0, 1.0], [1.0, 1.0]], np.float32)
    whole = tile_shares(tiles, (2 * TILE, 2 * TILE))
    assert whole.shape == (2 * TILE, 2 * TILE)
    assert whole[0, 0] == 0.0
    assert whole[-1, -1] == whole[0, -1] == 1.0
    assert np.abs(np.diff(whole, axis=0)).max() <= 1 / TILE + 1e-6
    assert (tile_shares(np.ones((1, 1), np.float32), (HEIGHT, WIDTH)) == 1).all()
