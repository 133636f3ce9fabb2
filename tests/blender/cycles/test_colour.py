"""Working spaces: white stays white and known matrices come out."""

from __future__ import annotations

import numpy as np
import pytest

from xrds_blender.cycles.colour import REC709, converted, to_rec709


@pytest.mark.parametrize("space", ["Linear Rec.2020", "ACEScg"])
def test_white_stays_white_and_back(space: str) -> None:
    matrix = to_rec709(space)
    np.testing.assert_allclose(matrix @ np.ones(3), 1.0, atol=1e-6)
    picture = np.random.default_rng(0).random((2, 3, 4)).astype(np.float32)
    there = converted(picture, matrix)
    np.testing.assert_array_equal(there[..., 3], picture[..., 3])
    back = converted(there, np.linalg.inv(matrix))
    np.testing.assert_allclose(back, picture, atol=1e-5)


def test_acescg_is_the_matrix_of_the_aces_project() -> None:
    expected = [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105]]
    expected.append([-0.0240, -0.1290, 1.1530])
    np.testing.assert_allclose(to_rec709("ACEScg"), expected, atol=2e-4)


def test_rec2020_is_the_matrix_of_bt2087() -> None:
    expected = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083]]
    expected.append([-0.0182, -0.1006, 1.1187])
    np.testing.assert_allclose(to_rec709("Linear Rec.2020"), expected, atol=2e-4)


@pytest.mark.parametrize("space", [REC709, "Something Else"])
def test_nothing_to_do(space: str) -> None:
    assert to_rec709(space) is None
