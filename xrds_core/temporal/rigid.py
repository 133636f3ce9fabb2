"""The places of rigid things that moved by themselves, by their matrices.

Exact over any number of frames, and for whatever the index names; blind to what bends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .motion import AGREEMENT_OF_MOVING, Detour, carry, centres, known, nearest, passage

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..arrays import Array
    from .frame import Matrix, Stored

# Of an object's matrix, relative to its largest number: less is no motion.
_SAME_MATRIX = 1e-6


def by_matrices(here: Stored, there: Stored) -> Detour | None:
    """Return the places of what moved between two frames; None if nothing did.

    Both frames need an index. Objects that one of them does not know are seen nowhere.
    """
    assert here.index is not None
    assert there.index is not None
    names = _moved(here.matrices, there.matrices)
    if not names:
        return None
    moving = np.isin(there.index, names)
    pixels = np.flatnonzero(np.isin(here.index, names))
    x, y = np.full((2, len(pixels)), np.nan, np.float32)
    shown = here.index[pixels]
    for name in names:
        part = np.flatnonzero(shown == name)
        if part.size and name in here.matrices and name in there.matrices:
            x[part], y[part] = _rigid(here, there, name, pixels[part])
    return Detour(pixels, x, y, moving)


def _moved(here: Mapping[int, Matrix], there: Mapping[int, Matrix]) -> list[int]:
    """Return the objects that moved in between, or that only one frame knows."""
    names = sorted(here.keys() | there.keys())
    return [x for x in names if not _same(here.get(x), there.get(x))]


def _same(old: Matrix | None, new: Matrix | None) -> bool:
    if old is None or new is None:
        return False
    return bool(np.abs(new - old).max() <= _SAME_MATRIX * np.abs(old).max())


def _rigid(
    here: Stored, there: Stored, name: int, pixels: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Return where pixels of one object were, NaN where there and back differ."""
    assert there.index is not None
    moved = there.matrices[name] @ np.linalg.inv(here.matrices[name])
    own_x, own_y = centres(pixels, here.shape[1])
    forth = passage(here.camera, there.camera, moved)
    x, y, _ = carry(forth, own_x, own_y, here.nearness[pixels])
    found = nearest(x, y, there.shape)
    centre_x, centre_y = centres(found.pixel, there.shape[1])
    back = passage(there.camera, here.camera, np.linalg.inv(moved))
    back_x, back_y, _ = carry(back, centre_x, centre_y, there.nearness[found.pixel])
    off_x, off_y = x - own_x + back_x - centre_x, y - own_y + back_y - centre_y
    same = found.seen & (there.index[found.pixel] == name)
    return known(x, y, same & (off_x**2 + off_y**2 < AGREEMENT_OF_MOVING**2))
