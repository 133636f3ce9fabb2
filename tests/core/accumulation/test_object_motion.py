"""The places of things that move by themselves, by Vector passes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from shots import CARD, PIXEL, WALL, View, World, camera, project, vector, view
from specification.places import Places, places

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import Stored, store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import pair

STEP = 3.3 * 5 * PIXEL  # of the card in a frame: 3.3 pixels
FRAMES = range(5)


def worlds() -> list[World]:
    return [World(card=(STEP * (k - 2), 0.0)) for k in FRAMES]


def views(pan: float) -> list[View]:
    pairs = zip(FRAMES, worlds(), strict=True)
    return [view(k, camera(x=pan * k), world) for k, world in pairs]


def by_vectors(shown: list[View]) -> list[Stored]:
    passes = [vector(shown, k, worlds()) for k in FRAMES]
    return [
        store(replace(each.frame, vector=one))
        for each, one in zip(shown, passes, strict=True)
    ]


def find(stored: list[Stored], here: int, there: int) -> Places:
    others = [x for k, x in enumerate(stored) if k != here]
    object_motions = Movement().object_motions(stored[here], others)
    at = others.index(stored[there])
    together = pair(stored[here], stored[there], object_motions[at])
    return places(together)


@pytest.mark.parametrize("pan", [0.0, 0.21])
@pytest.mark.parametrize("there", [0, 1, 3, 4])
def test_a_moving_card_is_followed(pan: float, there: int) -> None:
    shown = views(pan)
    result = find(by_vectors(shown), 2, there)
    card = shown[2].name == CARD
    point = shown[2].point[card] + [STEP * (there - 2), 0, 0]
    expected = project(shown[there].frame.camera, point)
    pixel = result.pixel.reshape(card.shape)[card]
    seen = result.seen.reshape(card.shape)[card]
    got = np.stack(np.divmod(pixel, card.shape[1])[::-1], -1) + 0.5
    # half floats and rounding of places: to a pixel
    assert np.abs(got - expected)[seen].max() < 0.55
    assert seen.mean() > 0.9


@pytest.mark.parametrize("pan", [0.0, 0.21])
def test_the_wall_takes_no_samples_of_a_card_that_passes(pan: float) -> None:
    shown = views(pan)
    stored = by_vectors(shown)
    for there in (0, 1, 3, 4):
        result = find(stored, 2, there)
        card = shown[2].name == CARD
        wall = ~_around(card).ravel()
        took = shown[there].name.ravel()[result.pixel]
        assert (took[wall & result.seen] == WALL).all()
        assert result.seen[wall].mean() > 0.6
        assert (took[card.ravel() & result.seen] == CARD).all()


def test_edges_of_what_moves_move_along_with_it() -> None:
    """Pixels at an edge hold some of both sides, as much as these in the next frame."""
    shown = views(0.0)
    card = [x.name == CARD for x in shown]
    result = find(by_vectors(shown), 2, 3)
    seen = result.seen.reshape(card[2].shape)
    took = result.pixel.reshape(card[2].shape)
    edge = [_around(x) & ~x for x in card]
    assert edge[2].sum() > 40
    moved = took - np.arange(took.size).reshape(took.shape)
    inner = card[2] & seen
    assert (inner | edge[2])[seen & (moved != 0)].all()
    assert seen[edge[2]].mean() > 0.9
    assert set(moved[edge[2] & seen]) <= set(moved[inner])
    still = seen & ~card[2] & ~edge[2]
    assert not edge[3].ravel()[took[still]].any()
    assert seen[~_around(card[2]) & ~_around(card[3])].all()


def _around(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return sliding_window_view(np.pad(mask, 1), (3, 3)).any((2, 3))


def test_without_them_a_card_leaves_ghosts() -> None:
    # so that the tests above are known to be able to fail
    shown = views(0.0)
    result = find([store(x.frame) for x in shown], 2, 3)
    wall = (shown[2].name == WALL).ravel()
    took = shown[3].name.ravel()[result.pixel]
    assert (took[(shown[2].name == CARD).ravel() & result.seen] == WALL).any() or (
        took[wall & result.seen] == CARD
    ).any()


def test_in_a_shot_in_steps_motion_is_taken_to_be_even() -> None:
    """Frames 0, 2 and 4: the pass of each leads to frames that are not there."""
    shown = views(0.0)
    stored = by_vectors(shown)[::2]
    result = find(stored, 1, 2)
    card = shown[2].name == CARD
    expected = project(shown[4].frame.camera, shown[2].point[card] + [2 * STEP, 0, 0])
    seen = result.seen.reshape(card.shape)[card]
    pixel = result.pixel.reshape(card.shape)[card]
    got = np.stack(np.divmod(pixel, card.shape[1])[::-1], -1) + 0.5
    assert np.abs(got - expected)[seen].max() < 0.6
    assert seen.mean() > 0.9


def test_one_movement_serves_a_whole_shot() -> None:
    stored = by_vectors(views(0.21))
    movement = Movement()
    for here in FRAMES:
        others = [x for k, x in enumerate(stored) if k != here]
        kept = movement.object_motions(stored[here], others)
        for old, new in zip(
            kept, Movement().object_motions(stored[here], others), strict=True
        ):
            assert old is not None
            assert new is not None
            assert np.array_equal(old.pixels, new.pixels)
            assert np.array_equal(old.x, new.x, equal_nan=True)
            assert np.array_equal(old.moving, new.moving)


def test_a_pane_that_moves_lends_little() -> None:
    """Its guides are what lies behind it, or it: chance in every sample of a frame."""
    rng = np.random.default_rng(3)
    shown = views(0.0)
    card = shown[2].name == CARD

    def samples(stored: list[Stored]) -> Any:
        return accumulate(stored[2], stored[:2] + stored[3:]).samples[card].mean()

    for each in shown:
        assert each.frame.radiance is not None
        grain = rng.standard_normal((*each.name.shape, 1))
        each.frame.radiance[...] = np.square(1.0 + 0.2 * grain)
    cards = samples(by_vectors(shown))
    for each in shown:
        chance = rng.random(each.name.shape) < 0.5
        each.frame.albedo[(each.name == CARD) & chance] = 1.0
        each.frame.albedo[(each.name == CARD) & ~chance] = 0.0
    panes = samples(by_vectors(shown))
    assert cards > 2.5
    assert panes < 1.2


def test_stereo_views_of_one_moment_need_no_vectors() -> None:
    world = worlds()[2]
    left, right = view(2, camera(), world), view(2, camera(x=0.3), world)
    motion = np.full((*left.name.shape, 4), 3.0, np.float32)
    stored = [store(replace(x.frame, vector=motion)) for x in (left, right)]
    result = find(stored, 0, 1)
    took = right.name.ravel()[result.pixel]
    assert result.seen.mean() > 0.9
    assert (took == left.name.ravel())[result.seen].all()
