from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

import xrds_core
from xrds_core.superres.front_end import to_picture, to_planes


def test_a_picture_returns_as_it_was() -> None:
    picture = np.random.default_rng(0).random((4, 5, 3), np.float32)
    planes = to_planes(picture)
    assert planes.shape == (1, 3, 4, 5)
    assert planes[0, 2, 1, 4] == picture[1, 4, 2]
    assert to_picture(planes).flags.c_contiguous
    np.testing.assert_array_equal(to_picture(planes), picture)


def test_channels_stay_side_by_side() -> None:
    """What the network's sums, and so its last digits, depend on."""
    picture = np.zeros((4, 5, 3), np.float32)
    planes = to_planes(picture)
    assert planes.is_contiguous(memory_format=torch.channels_last)
    assert planes.data_ptr() == picture.ctypes.data


def test_any_floats_in_any_order_become_float32() -> None:
    picture = np.arange(60.0).reshape(5, 4, 3)[::-1]
    np.testing.assert_array_equal(to_picture(to_planes(picture)), picture)
    assert to_planes(picture).dtype == torch.float32


def test_layouts_and_the_array_type_are_stated_once() -> None:
    facts = {"permute(2, 0, 1)[None]": "front_end", "NDArray[np.float32]": "arrays"}
    sources = [*Path(xrds_core.__file__).parent.rglob("*.py")]
    for text, module in facts.items():
        assert [path.stem for path in sources if text in path.read_text()] == [module]
