"""Where pixels were in another frame, against rays worked out by hand."""

from __future__ import annotations

from math import tan

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from shots import (
    CARD,
    FOCUS,
    HEIGHT,
    PIXEL,
    WIDTH,
    Camera,
    View,
    World,
    camera,
    project,
    view,
)
from specification.places import Places, places, still_places

from xrds_core.accumulation.frame import store
from xrds_core.accumulation.reprojection import grid, pair, reproject, reprojection
from xrds_core.accumulation.weighted_sums import find_spots

CAMERAS = [
    camera(x=0.37),
    camera(x=-0.2, y=0.11, z=-0.5),
    camera(yaw=0.03),
    camera(x=0.3, z=1.0, yaw=-0.05),
    camera(window=(7, 5)),
]


def found(here: View, there: View) -> Places:
    return places(pair(store(here.frame), store(there.frame)))


@pytest.mark.parametrize("eye", CAMERAS)
@pytest.mark.parametrize("flat", [False, True])
def test_the_wall_is_found_where_rays_say(eye: Camera, flat: bool) -> None:
    if flat:
        where = np.linalg.inv(eye.view)[:3, 3]
        eye = camera(*where, orthographic=True, window=eye.window)
    here, there = view(0, camera(orthographic=flat)), view(1, eye)
    own = grid(here.name.shape)
    forth = reprojection(here.frame.camera, eye)
    x, y, near = reproject(forth, own.x, own.y, store(here.frame).inverse_depth)
    expected = project(eye, here.point).reshape(-1, 2)
    assert np.stack([x, y], -1) == pytest.approx(expected, abs=2e-3)
    depth = -(np.append(here.point, np.ones((*here.name.shape, 1)), -1) @ eye.view[2])
    assert near == pytest.approx(depth.ravel() if flat else 1 / depth.ravel(), rel=1e-4)
    result = found(here, there)
    inside = ((expected > 0.01) & (expected < [WIDTH - 0.01, HEIGHT - 0.01])).all(-1)
    assert inside.mean() > 0.5
    assert np.array_equal(result.seen[inside], np.ones(inside.sum(), bool))
    off = expected - np.floor(expected) - 0.5
    # and what the way there and back leaves over, where the scale changes
    beyond = result.apart[inside] - (off**2).sum(-1)[inside]
    assert -5e-3 < beyond.min() <= beyond.max() < 0.02


def test_a_still_camera_finds_every_pixel_in_itself() -> None:
    here = view(0, camera(x=3.0, y=-2.0, yaw=0.4), World(card=(1.5, -2.0)))
    result = found(here, here)
    assert result.seen.all()
    assert np.array_equal(result.pixel, np.arange(WIDTH * HEIGHT))
    assert result.apart.max() < 1e-5


def test_far_from_the_origin_nothing_is_lost() -> None:
    # a metre at a distance of 1000 km: float32 alone could not tell the pixels apart
    far = 1e6
    world = World(wall_half=1e7)
    here, there = view(0, camera(x=far), world), view(1, camera(x=far + 0.37), world)
    near = found(view(0, camera(), world), view(1, camera(x=0.37), world))
    assert np.array_equal(found(here, there).pixel, near.pixel)


def test_what_the_card_covers_is_not_seen() -> None:
    world = World(card=(0.0, 0.0))
    here, there = view(0, camera(), world), view(1, camera(x=0.7), world)
    result = found(here, there)
    # a pixel is truly there if the other frame's own ray hits the same place
    apart = np.abs(there.point.reshape(-1, 3)[result.pixel] - here.point.reshape(-1, 3))
    same = (apart.max(-1) < 1.01 * 10 * PIXEL) & (
        there.name.ravel()[result.pixel] == here.name.ravel()
    )
    covered = ~same & (result.pixel > 0)
    assert covered.sum() > 50
    assert not result.seen[covered].any()
    assert result.seen[same & (result.pixel > 0)].mean() > 0.98


def test_edges_keep_both_sides_that_move_alike() -> None:
    # beside the card, the other frame may show the card: that is the edge's own mixture
    world = World(card=(0.0, 0.0), card_z=-9.9)
    here, there = view(0, camera(), world), view(1, camera(x=2.45 * 10 * PIXEL), world)
    result = found(here, there)
    other = there.name.ravel()[result.pixel] != here.name.ravel()
    assert (other & result.seen).sum() > 5


@pytest.mark.parametrize(
    ("eye", "card_z", "more"),
    [
        (camera(x=6 * 5 * PIXEL), -5.0, 0.5),  # the card moves 6 pixels, the wall 3
        (camera(x=3 * 10 * PIXEL), -9.9, 0.0),  # both 3: their mixture moves with them
        (camera(yaw=0.1), -5.0, 0.0),  # a turning camera moves all alike
    ],
)
def test_pixels_beside_a_nearer_thing_that_moves_otherwise_count_as_farther(
    eye: Camera, card_z: float, more: float
) -> None:
    world = World(card=(0.0, 0.0), card_z=card_z)
    here, there = view(0, camera(), world), view(1, eye, world)
    two = pair(store(here.frame), store(there.frame))
    result, (plain, _) = places(two), still_places(two)
    mixed = beside_card(here).ravel() | beside_card(there).ravel()[result.pixel]
    mixed &= result.seen
    assert mixed.sum() > 40
    added = result.apart - plain.apart
    assert added[mixed] == pytest.approx(more, abs=0.01)
    assert not added[~mixed].any()


@pytest.mark.parametrize(("samples", "pixels"), [(2.0, 3), (4.0, 6)])
def test_edges_move_with_the_nearer_side_unless_samples_are_few(
    samples: float, pixels: int
) -> None:
    world = World(card=(0.0, 0.0), card_z=-5.0)
    eye = camera(x=6 * 5 * PIXEL)  # the card moves 6 pixels, the wall 3
    here = view(0, camera(), world, samples=samples)
    there = view(1, eye, world, samples=samples)
    found = find_spots(pair(store(here.frame), store(there.frame)), 1)
    edge = beside_card(here).ravel() & found.seen
    moved = found.pixel - np.arange(found.pixel.size)
    assert edge.sum() > 20
    assert np.median(np.abs(moved[edge])) == pixels  # of few samples it is jittered


@pytest.mark.parametrize(
    ("samples", "pixels", "loose"),
    [(2.0, 2.0, True), (2.0, 2.4, False), (4.0, 2.0, False), (2.0, 0.0, False)],
)
def test_frames_of_few_samples_do_not_all_show_the_same_points(
    samples: float, pixels: float, loose: bool
) -> None:
    """What moves by whole pixels would: a frame's first samples are pixels' centres."""
    eye = camera(x=pixels * 10 * PIXEL)
    here, there = view(0, camera(), samples=samples), view(1, eye, samples=samples)
    own = grid(here.name.shape)
    result = found(here, there)
    straight = np.floor(own.x - pixels) + np.floor(own.y) * WIDTH
    seen = result.seen & (own.x > pixels + 1)
    assert seen.mean() > 0.8
    moved = (result.pixel != straight)[seen]
    assert 0.2 < moved.mean() < 0.5 if loose else not moved.any()
    down, right = np.divmod(result.pixel[seen].astype(int), WIDTH)
    assert np.abs(right + 0.5 - own.x[seen] + pixels).max() < 1.01
    assert np.abs(down + 0.5 - own.y[seen]).max() < 1.01


def beside_card(seen: View) -> NDArray[np.bool_]:
    """Pixels that show no card but have it among the eight around them."""
    card = np.pad(seen.name == CARD, 1)
    return sliding_window_view(card, (3, 3)).any((2, 3)) & ~card[1:-1, 1:-1]


def test_sky_turns_with_the_camera_alone() -> None:
    yaw = 0.08
    world = World(wall_half=0.1)
    here = view(0, camera(), world)
    there = view(1, camera(x=5.0, y=3.0, yaw=yaw), world)
    result = found(here, there)
    middle = HEIGHT // 2 * WIDTH + WIDTH // 4
    right = (WIDTH // 4 + 0.5) / WIDTH * 2 - 1
    angle = np.arctan(right / FOCUS) + yaw  # the camera turned left, the sky goes right
    expected = (tan(angle) * FOCUS + 1) / 2 * WIDTH
    assert result.seen[middle]
    assert result.pixel[middle] % WIDTH == int(expected)
    wall = (here.name == 1).ravel()
    assert wall.any()
    assert (there.name.ravel()[result.pixel[wall & result.seen]] == 1).all()


def test_an_orthographic_sky_and_unknown_depths_lend_nothing() -> None:
    world = World(wall_half=1.0)
    here = view(0, camera(orthographic=True), world)
    result = found(here, here)
    assert np.array_equal(result.seen, (here.name == 1).ravel())
    spoilt = view(0, camera())
    spoilt.frame.depth[3, 4], spoilt.frame.depth[5, 6] = np.nan, -1.0
    assert found(spoilt, spoilt).seen.sum() == WIDTH * HEIGHT - 2


def test_what_lies_behind_the_other_camera_is_not_seen() -> None:
    here, there = view(0, camera()), view(1, camera(yaw=np.pi))
    assert not found(here, there).seen.any()


def test_another_place_behind_a_cut_lends_nothing() -> None:
    here, there = view(0, camera()), view(1, camera(), World(wall_z=-4.0))
    assert not found(here, there).seen.any()  # by nearness: the camera has not moved
    moved = view(1, camera(x=1.0), World(wall_z=-4.0))
    assert not found(here, moved).seen.any()


def test_depth_of_positions() -> None:
    eye = camera(x=1.0, yaw=0.2)
    here = view(0, eye, World(wall_half=8.0))
    position = np.where((here.name == 0)[..., None], 0.0, here.point)
    depth = eye.depth(position.astype(np.float32))
    assert np.array_equal(np.isinf(depth), here.name == 0)
    hit = here.name != 0
    assert depth[hit] == pytest.approx(here.frame.depth[hit], rel=1e-5)


def test_a_window_finds_what_the_whole_frame_finds() -> None:
    shape = (20, 30)
    whole = found(view(0, camera()), view(1, camera(x=0.37)))
    part = found(
        view(0, camera(window=(9, 8)), shape=shape),
        view(1, camera(x=0.37, window=(9, 8)), shape=shape),
    )
    inner = np.s_[8:28, 9:39]
    row, column = np.divmod(whole.pixel.reshape(HEIGHT, WIDTH)[inner], WIDTH)
    seen = part.seen.reshape(shape)
    assert seen.mean() > 0.9
    assert np.array_equal(
        part.pixel.reshape(shape)[seen], ((row - 8) * 30 + column - 9)[seen]
    )
