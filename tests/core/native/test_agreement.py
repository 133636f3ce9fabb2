"""The compiled library computes what the specification says, in NumPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import astuple, fields, replace
from typing import Any

import numpy as np
import pytest
import specification.packing
from native_shots import (
    CAMERAS,
    ODD,
    SAMPLES,
    SHAPES,
    Apart,
    Kind,
    apart,
    flipped,
    passes_of,
    random_kind,
    shot,
    specified,
)
from numpy.typing import NDArray
from shots import camera
from specification.coarse_rejection import compared
from specification.filters import extreme
from specification.places import SURFACE, ranges, still_places

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import (
    Frame,
    Halves,
    Stored,
    pack_frame,
    pack_parts,
    pack_vectors,
)
from xrds_core.accumulation.local_filters import find_ranges, find_rims
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import Pair, pair
from xrds_core.accumulation.weighted_sums import Work, compare_spots, find_spots
from xrds_core.native.library import library

Array = NDArray[Any]

GUIDES = Kind(light=False)
PASSES = (
    Kind(alpha=True),
    Kind(parts=True),
    Kind(counts=True),
    Kind(invalid=True),
    Kind(invalid=True, counts=True, alpha=True, parts=True),
    Kind(halves=True),
    Kind(halves=True, counts=True),
    Kind(sky=True),
    Kind(sizes=True),
    Kind(extreme=True, invalid=True),
    GUIDES,
    replace(GUIDES, alpha=True),
    replace(GUIDES, invalid=True, counts=True, parts=True),
)
MOTION = (
    Kind(moving=True),
    Kind(moving=True, sizes=True, samples=1.0),
    Kind(mirror=True),
    Kind(mirror=True, camera="orthographic", samples=2.0),
    Kind(mirror=True, moving=True, invalid=True),
)
EDGES = (*SHAPES, (257, 1031))
# Of the pixels of all random shots, those that are not alike, and those that take
# another pixel of a neighbour.
OTHERS, FLIPPED = 1e-4, 1e-4
# How far any pixel may be from the specification, as a share of the mean light; where
# sums of squares of the largest half floats cancel, they have fewer digits.
MOST, MOST_IF_EXTREME = 1e-3, 5e-2


def told(kind: Any) -> str:
    """What is unusual about a kind, or a size."""
    if not isinstance(kind, Kind):
        return "x".join(map(str, kind))
    given = {f.name: getattr(kind, f.name) for f in fields(kind)}
    return " ".join(f"{k}={v}" for k, v in given.items() if v != getattr(Kind, k))


pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of infinities


@pytest.fixture(autouse=True)
def all_levels() -> Iterator[None]:
    yield
    library().limit_level(3)


def at_level(level: int, target: Stored, others: list[Stored]) -> Accumulated:
    library().limit_level(level)
    return accumulate(target, others)


def same(one: Accumulated, two: Accumulated) -> bool:
    """Whether all bits of two results are equal."""
    passes, others = passes_of(one), passes_of(two)
    return all(
        np.array_equal(passes[name], others[name], equal_nan=True) for name in passes
    )


def agree(kind: Kind) -> Apart:
    """Compare a shot; fails where levels differ, or any pixel does by far."""
    target, others = shot(kind)
    found, slow = (at_level(level, target, others) for level in (3, 1))
    assert same(found, slow)
    flips = flipped(target, others)
    result = apart(found, specified(target, others), flips)
    most = MOST_IF_EXTREME if kind.extreme else MOST
    assert max(result.passes.values()) < most, (kind, result)
    assert result.flipped or result.rejected < 1e-5
    return result


def assert_agrees(kind: Kind) -> None:
    result = agree(kind)
    assert result.others == result.flipped == 0


@pytest.mark.parametrize("samples", SAMPLES)
@pytest.mark.parametrize("name", CAMERAS)
def test_cameras(name: str, samples: float) -> None:
    assert_agrees(Kind(name, samples=samples))


@pytest.mark.parametrize("kind", PASSES, ids=told)
def test_passes(kind: Kind) -> None:
    assert_agrees(kind)


@pytest.mark.parametrize("kind", MOTION, ids=told)
def test_what_moves_by_itself(kind: Kind) -> None:
    assert_agrees(kind)


@pytest.mark.parametrize("light", [True, False])
@pytest.mark.parametrize("shape", EDGES, ids=told)
def test_sizes(shape: tuple[int, int], light: bool) -> None:
    """An area is 128 x 512: large pictures have seams."""
    kind = Kind("turn", shape, sides=(1, 1), light=light, alpha=light, parts=light)
    assert_agrees(kind)


@pytest.mark.parametrize("sides", [(0, 0), (1, 0), (0, 1), (0, 4), (4, 0)])
def test_few_neighbours(sides: tuple[int, int]) -> None:
    assert_agrees(Kind(sides=sides))


def test_two_groups_without_neighbours() -> None:
    target, _ = shot(Kind(alpha=True, parts=True, invalid=True))
    given = target, None, 1.0, tuple(target.parts), 2
    found, expected = (
        work(*given).means([[], []]) for work in (Work, specification.Work)
    )
    assert found.reused == expected.reused == 0.0
    for one, two in zip(
        [*found.passes, *found.parts, found.samples],
        [*expected.passes, *expected.parts, expected.samples],
        strict=True,
    ):
        assert np.array_equal(one, two, equal_nan=True)


@pytest.mark.parametrize("name", ["turn", "panorama", "still", "whole"])
def test_threads_change_nothing(name: str) -> None:
    target, others = shot(Kind(name, (300, 530), sides=(1, 1), parts=True))
    found = [accumulate(target, others, threads=n) for n in (1, 2, 7)]
    assert same(found[0], found[1])
    assert same(found[0], found[2])


@pytest.mark.nightly
@pytest.mark.parametrize("first", range(0, 400, 40))
def test_random_shots(first: int) -> None:
    pixels, others, flips = 0, 0, 0
    for seed in range(first, first + 40):
        kind = random_kind(seed)
        result = agree(kind)
        pixels += kind.shape[0] * kind.shape[1]
        flips += result.flipped
        # near the poles of a panorama, offsets have few digits
        is_sure = not kind.extreme and kind.camera not in ("panorama", "part")
        others += result.others if is_sure else 0
    assert others <= OTHERS * pixels
    assert flips <= FLIPPED * pixels


def pairs(kind: Kind) -> list[Pair]:
    target, others = shot(kind)
    return [pair(target, other) for other in others]


@pytest.mark.parametrize("step", [1, 2, 4])
@pytest.mark.parametrize("shape", [(48, 64), (1, 7), (7, 1), (3, 130)])
@pytest.mark.parametrize("name", CAMERAS)
def test_spots(name: str, shape: tuple[int, int], step: int) -> None:
    rows, columns = np.mgrid[step // 2 : shape[0] : step, step // 2 : shape[1] : step]
    at = (rows * shape[1] + columns).ravel()
    for each in pairs(Kind(name, shape, 2.0, extreme=True)):
        found, in_frame = still_places(each)
        spots = find_spots(each, step)
        assert np.array_equal(spots.seen, found.seen[at])
        assert np.array_equal(spots.in_frame, in_frame[at])
        assert np.array_equal(spots.pixel[spots.seen], found.pixel[at][spots.seen])


@pytest.mark.parametrize("light", [True, False])
@pytest.mark.parametrize("shape", [(140, 150), (1, 1), (9, 130)])
@pytest.mark.parametrize("name", CAMERAS)
def test_first_look(name: str, shape: tuple[int, int], light: bool) -> None:
    target, others = shot(
        Kind(name, shape, 2.0, light=light, moving=True, invalid=True)
    )
    others[0] = replace(others[0], samples=3.0)
    for other, motion in zip(
        others, Movement().object_motions(target, others), strict=True
    ):
        both = pair(target, other, motion)
        found = compare_spots(both, 2)
        tiles, counts = compared(both, 2)
        assert list(astuple(found)[1:]) == counts
        assert np.allclose(found.tiles, tiles, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("level", [1, 3])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (140, 37)])
def test_surfaces(shape: tuple[int, int], level: int) -> None:
    library().limit_level(level)
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.0, 2.0, shape[0] * shape[1]).astype(np.float32)
    depth[::5] = np.float32(1.0) + rng.uniform(0, 0.04, depth[::5].size)
    odd = rng.random(depth.size) < 0.4
    depth[odd] = rng.choice([0.0, -0.0, np.nan, 1e30, -1.0], int(odd.sum()))
    stored = shot(Kind(shape=shape))[0]
    frame = replace(stored, inverse_depth=depth)
    expected = ranges(frame)
    for one, two in zip(find_ranges(depth, shape), expected, strict=True):
        assert np.array_equal(one, two, equal_nan=True)
    for function in (np.fmin, np.fmax):
        near = extreme(depth.reshape(shape), function, 1).ravel()
        rims = np.abs(near - depth) > np.float32(SURFACE) * np.abs(depth)
        found = find_rims(depth, shape, function is np.fmin)
        assert np.array_equal(found > 0, rims)
        row, column = np.divmod(np.flatnonzero(rims), shape[1])
        down, across = np.divmod(found[rims].astype(int) - 1, 3)
        row = np.clip(row + down - 1, 0, shape[0] - 1)
        column = np.clip(column + across - 1, 0, shape[1] - 1)
        assert np.array_equal(depth[row * shape[1] + column], near[rims])


def frame_to_pack(change: Callable[[Array], Array], **more: Any) -> Frame:
    """A frame with all that is odd, its passes as `change` hands them over."""
    rng = np.random.default_rng(11)
    shape = (131, 37)

    def odd(*deep: int, share: float = 0.01) -> Array:
        x = rng.standard_normal((*shape, *deep)) ** 3
        x *= rng.choice([1e-8, 1e-3, 1.0, 1.0, 1e5], x.shape)
        where = rng.random(x.shape) < share
        x[where] = rng.choice([*ODD, 65504, 65519.9, 65520, -7e4], int(where.sum()))
        return change(x.astype(np.float32))

    light, others = more.pop("light", True), more.pop("halves", None)
    alpha = odd() if more.pop("alpha", False) else None
    halves = None
    if others is not None:
        radiance = np.stack([odd(3), odd(3)])
        counts = rng.integers(0, 4, (2, *shape)).astype(np.float32)
        counts = counts if others == "counts" else None
        shares = (0.5, 0.5) if others == "counts" else others
        halves = Halves(radiance, shares, counts)
    radiance = odd(3) if light else None
    depth = np.ones(shape, np.float32)
    return Frame(
        number=1,
        camera=camera(),
        radiance=radiance,
        albedo=odd(3),
        normal=odd(3),
        depth=depth,
        samples=3.0,
        alpha=alpha,
        halves=halves,
    )


HANDED: dict[str, Callable[[Array], Array]] = {
    "as they are": lambda x: x,
    "of more channels": lambda x: np.repeat(x[..., None], 2, -1)[..., 0],
    "upside down": lambda x: x[::-1],
    "mirrored": lambda x: x[:, ::-1],
    "doubles": lambda x: x.astype(np.float64),
    "halves": lambda x: x.astype(np.float16),
    "columns first": np.asfortranarray,
    "big endian": lambda x: x.astype(">f4"),
    "between others": lambda x: np.repeat(np.repeat(x, 2, 0), 3, 1)[::2, ::3],
}


def assert_packed(frame: Frame) -> None:
    picture, invalid, noise = pack_frame(frame)
    expected, where = specification.packing.picture(frame)
    assert np.array_equal(invalid, where)
    assert np.array_equal(picture, expected)
    if frame.radiance is None:
        assert noise is None
        return
    assert noise is not None
    assert_near(noise.guides, specification.packing.guides(frame))
    if frame.halves is not None:
        assert_near(noise.light, specification.packing.light(frame))


def assert_near(found: Array, expected: Array) -> None:
    """To a step of half floats; in differences of near numbers, to one of theirs."""
    assert found.dtype == np.float16
    one, two = found.astype(np.float64), expected.astype(np.float64)
    np.testing.assert_allclose(one, two, rtol=2.0**-10, atol=2.0**-20)


@pytest.mark.parametrize("level", [1, 3])
@pytest.mark.parametrize("handed", HANDED)
def test_packing(handed: str, level: int) -> None:
    library().limit_level(level)
    change = HANDED[handed]
    for light in (True, False):
        for alpha in (True, False):
            assert_packed(frame_to_pack(change, light=light, alpha=alpha))
    assert_packed(frame_to_pack(change, halves=(0.5, 0.5), alpha=True))


@pytest.mark.parametrize(
    "halves", [(0.5, 0.5), (0.25, 0.75), (0.0, 1.0), (1.0, 0.0), "counts"]
)
def test_packing_of_half_buffers(halves: Any) -> None:
    assert_packed(frame_to_pack(lambda x: x, halves=halves))


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (1, 300), (300, 1)])
def test_packing_of_small_pictures(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    names = ("radiance", "albedo", "normal")
    passes = {name: rng.random((*shape, 3)).astype(np.float32) for name in names}
    depth = np.ones(shape, np.float32)
    assert_packed(Frame(number=1, camera=camera(), depth=depth, **passes))


def numbers() -> Array:
    """Floats at and beside every border that rounding to half floats has."""
    halves = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
    finite = np.unique(halves[np.isfinite(halves)])
    ties = ((finite[1:].astype(np.float64) + finite[:-1]) / 2).astype(np.float32)
    known = [65504.0, 65519.996, 65520.0, 65536.0, 1e-45, 1e-38, 3e38, 2.0**-25, 0.0]
    every = np.concatenate([halves, ties, np.array(known, np.float32)])
    beside = [np.nextafter(every, np.float32(end)) for end in (-np.inf, np.inf)]
    every = np.concatenate([every, *beside])
    return np.concatenate([every, -every])


@pytest.mark.parametrize("level", [1, 3])
def test_numbers_become_half_floats_as_in_numpy(level: int) -> None:
    library().limit_level(level)
    x = numbers()
    picture = np.resize(x, (len(x) // 4 + 1, 1, 4))
    expected = picture.astype(np.float16).reshape(-1, 4)
    found = pack_vectors(picture)
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    known = ~np.isnan(expected)
    assert np.array_equal(found.view(np.uint16)[known], expected.view(np.uint16)[known])


@pytest.mark.parametrize("level", [1, 3])
def test_parts_are_packed(level: int) -> None:
    library().limit_level(level)
    x = np.resize(numbers(), (len(numbers()) // 3, 1, 3))
    kept = np.where(np.isfinite(x), np.clip(x, -65504, 65504), 0).astype(np.float16)
    packed = pack_parts({"key": x, "dark": 0 * kept, "minus": -0.0 * np.abs(kept)})
    assert packed["dark"] is None
    assert packed["minus"] is None
    assert np.array_equal(packed["key"], kept.reshape(-1, 3))


@pytest.mark.parametrize("level", [1, 3])
def test_half_floats_become_numbers(level: int) -> None:
    """A frame without neighbours is itself, whatever it holds."""
    library().limit_level(level)
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    finite = np.resize(every[np.isfinite(every)], (64 * 256, 6))
    target = replace(
        shot(Kind(shape=(64, 256), light=False))[0], picture=finite, invalid=None
    )
    found = accumulate(target, [])
    both = np.concatenate([found.albedo, found.normal], axis=-1).reshape(-1, 6)
    assert np.array_equal(both, finite.astype(np.float32))
