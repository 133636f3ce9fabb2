from __future__ import annotations

import numpy as np
import pytest

from xrds_core.superres.tiling import fit, tiles

SIZES = (1, 7, 16, 31, 64, 65, 100, 257)


@pytest.mark.parametrize("scale", [1, 2, 4])
@pytest.mark.parametrize("length", SIZES)
@pytest.mark.parametrize("tile", [0, 33, 64, 128])
@pytest.mark.parametrize(("overlap", "multiple"), [(8, 16), (16, 16), (32, 16)])
def test_weights_add_up_to_one(
    length: int, tile: int, overlap: int, multiple: int, scale: int
) -> None:
    total = np.zeros((length * scale, 40 * scale))
    for part in tiles(length, 40, (tile, tile), overlap, multiple):
        rows = part.rows.output(scale, length * scale)
        columns = part.columns.output(scale, 40 * scale)
        total[rows, columns] += part.weights(scale)
    np.testing.assert_allclose(total, 1.0, atol=1e-6)


@pytest.mark.parametrize("length", SIZES)
def test_tiles_are_within_their_size_and_on_the_grid(length: int) -> None:
    for part in tiles(length, length, (96, 64), overlap=32, multiple=16):
        assert 0 < part.rows.size <= 96
        assert 0 < part.columns.size <= 64
        assert part.rows.start % 16 == part.columns.start % 16 == 0


def test_neighbours_share_the_overlap_and_edges_share_nothing() -> None:
    first, second, last = tiles(100, 10, (64, 64), overlap=32, multiple=16)[:3]
    assert first.rows.overlap_before == last.rows.overlap_after == 0
    assert first.rows.stop - second.rows.start == 32 == second.rows.overlap_before
    assert first.columns.overlap_before == first.columns.overlap_after == 0


def test_what_lies_at_a_tiles_inner_edge_counts_nothing() -> None:
    first, second = tiles(64, 10, (48, 48), overlap=24, multiple=8)[:2]
    assert not first.weights(2)[-8:].any()
    assert not second.weights(2)[:8].any()


def test_a_small_picture_is_one_tile() -> None:
    (tile,) = tiles(33, 17, (48, 48), overlap=16, multiple=16)
    assert (tile.rows.size, tile.columns.size) == (33, 17)
    assert (tile.weights(2) == 1.0).all()


@pytest.mark.parametrize("size", [(540, 960), (20, 960), (960, 20), (1, 1)])
@pytest.mark.parametrize("pixels", [0.0, 5000.0, 100_000.0, 1e12])
def test_tiles_fit_the_pixels_they_may_have(
    size: tuple[int, int], pixels: float
) -> None:
    height, width = fit(*size, pixels, overlap=32, multiple=16)
    assert height * width <= max(pixels, 64 * 64)
    covered = tiles(*size, (height, width), overlap=32, multiple=16)
    assert max(t.rows.size * t.columns.size for t in covered) <= max(pixels, 64 * 64)
    assert pixels < 1e12 or len(covered) == 1


def test_long_pictures_are_not_cut_along_their_short_side() -> None:
    assert fit(40, 4000, 50_000, overlap=16, multiple=16) == (48, 1040 // 16 * 16)
