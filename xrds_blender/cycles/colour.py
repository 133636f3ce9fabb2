"""The file's working space and Rec.709, in which the networks were trained.

Blender keeps the working space per file from 5.0 on; before, it is linear Rec.709.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xrds_core.arrays import Array

REC709 = "Linear Rec.709"
# Chromaticities (x, y) of red, green, blue and white: ITU-R BT.709 and BT.2020, and
# AP1 of SMPTE ST 2065-1's ACEScg (S-2014-004).
_SPACES = {
    REC709: ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290)),
    "Linear Rec.2020": (
        (0.708, 0.292),
        (0.170, 0.797),
        (0.131, 0.046),
        (0.3127, 0.3290),
    ),
    "ACEScg": ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), (0.32168, 0.33767)),
}
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def working_space() -> str:
    """The name of the open file's working space."""
    import bpy

    settings = getattr(bpy.data, "colorspace", None)
    return REC709 if settings is None else settings.working_space


def to_rec709(space: str) -> Array | None:
    """The 3x3 matrix from a working space, or None where there is nothing to do.

    An unknown space is taken as it is.
    """
    if space == REC709 or space not in _SPACES:
        return None
    matrix = np.linalg.inv(_to_xyz(REC709)) @ _to_xyz(space)
    return matrix.astype(np.float32)


def converted(picture: Array, matrix: Array) -> Array:
    """The first three channels times a matrix; further ones, as alpha, as they are."""
    colour = picture[..., :3] @ matrix.T
    return np.concatenate([colour, picture[..., 3:]], -1)


def _to_xyz(space: str) -> NDArray[np.float64]:
    """RGB to XYZ, with the white of Rec.709 (Bradford's adaptation)."""
    *primaries, white = (_xyz(point) for point in _SPACES[space])
    columns = np.stack(primaries, 1)
    matrix = columns * np.linalg.solve(columns, white)
    have, wanted = _BRADFORD @ white, _BRADFORD @ _xyz(_SPACES[REC709][3])
    adapt = np.linalg.inv(_BRADFORD) @ np.diag(wanted / have) @ _BRADFORD
    return adapt @ matrix


def _xyz(point: tuple[float, float]) -> NDArray[np.float64]:
    x, y = point
    return np.array([x / y, 1.0, (1 - x - y) / y])
