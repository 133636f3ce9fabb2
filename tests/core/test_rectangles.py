"""Rectangles that cover marked blocks."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_core.finish import rectangles


@pytest.mark.parametrize("most", [1, 2, 4])
def test_rectangles_cover_what_is_marked(most: int) -> None:
    blocks = np.zeros((12, 20), bool)
    blocks[1:3, 2:4] = blocks[8, 15:19] = blocks[11, 0] = True
    found = rectangles(blocks, most=most)
    covered = np.zeros_like(blocks)
    for area in found:
        assert not covered[area].any()  # nothing is rendered twice
        covered[area] = True
    assert covered[blocks].all()
    assert len(found) <= most
    if most == 4:
        assert covered.sum() == blocks.sum()


def test_a_rectangle_is_divided_where_that_leaves_out_much() -> None:
    blocks = np.zeros((12, 20), bool)
    blocks[0, 0] = blocks[0, 4] = blocks[11, 15] = blocks[11, 19] = True
    assert len(rectangles(blocks)) == 4
    blocks[:] = True
    blocks[0, :4] = False
    assert len(rectangles(blocks)) == 1


def test_nothing_marked_is_no_rectangle() -> None:
    assert rectangles(np.zeros((3, 4), bool)) == []
