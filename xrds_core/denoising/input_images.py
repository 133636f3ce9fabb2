"""The arrays given to a denoiser: checked, cleaned, and sampled for their noise.

Arrays are float32 (height, width, channels).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import float_array
from ..errors import PictureError
from ..holes import clean_alpha, clean_radiance, fill_holes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..arrays import Array


_SIDE = 4  # blocks along a side of a sample
_BLOCK = 64  # pixels along a side of a block
_WORTH = 4  # samples: a smaller picture is prefiltered sooner than sampled


@dataclass(frozen=True)
class Pictures:
    """One picture and its guides, without NaN, infinities or negative radiance."""

    radiance: Array
    """(H, W, 3)"""
    alpha: Array
    """(H, W, 1), or (H, W, 0) where none was given."""
    guides: dict[str, Array]
    """`albedo` and `normal`, those that were given, (H, W, 3)."""
    parts: dict[str, Array]
    """Light that radiance is made of, by name, (H, W, 3)."""
    bad_pixels: int

    @cached_property
    def lit(self) -> tuple[str, ...]:
        """Names of the parts that have any light."""
        return tuple(name for name, part in self.parts.items() if part.any())


def check(
    radiance: Any, albedo: Any, normal: Any, parts: Mapping[str, Any]
) -> Pictures:
    """Check and clean the arrays given to a denoiser.

    Parameters
    ----------
    radiance : array_like
        (H, W, 3) or (H, W, 4) floats.
    albedo, normal : array_like or None
        (H, W, 3) floats.
    parts : mapping of str to array_like
        AOVs and light passes, (H, W, 3), by name.

    Returns
    -------
    pictures : Pictures
        Without NaN, infinities or negative radiance. Float32 arrays without a fault are
        not copied.

    Raises
    ------
    PictureError
        If arrays do not fit each other; it states their sizes and the remedy.
    """
    whole = float_array("radiance", radiance, (3, 4))
    given = {"albedo": albedo, "normal": normal}
    guides = {k: float_array(k, v, (3,)) for k, v in given.items() if v is not None}
    lights = {name: float_array(name, part, (3,)) for name, part in parts.items()}
    for name, other in [*guides.items(), *lights.items()]:
        if other.shape[:2] != whole.shape[:2]:
            raise PictureError(
                f"{name} is {_size_text(other)} pixels, but radiance is "
                f"{_size_text(whole)}: give both of one render"
            )
    light, bad_pixels = clean_radiance(whole[..., :3])
    alpha, holes = clean_alpha(whole[..., 3:])
    filled = {name: fill_holes(guide) for name, guide in guides.items()}
    clean = {name: clean_radiance(part) for name, part in lights.items()}
    bad_pixels += holes + sum(n for _, n in (*filled.values(), *clean.values()))
    held, made_of = (
        {k: x for k, (x, _) in images.items()} for images in (filled, clean)
    )
    return Pictures(light, alpha, held, made_of, bad_pixels)


def sample(guide: Array) -> Array | None:
    """Return blocks of a guide that show whether it is noisy.

    Half of them are the busiest, the others represent the rest of the picture.

    Parameters
    ----------
    guide : (H, W, 3) float32 array
        Albedo or normal.

    Returns
    -------
    blocks : (h, w, 3) float32 array or None
        The blocks side by side. None where the picture is so small that a sample would
        save no time.
    """
    rows, columns = (size // _BLOCK for size in guide.shape[:2])
    count = _SIDE**2
    if rows * columns < _WORTH * count:
        return None
    blocks = _split_blocks(guide[: rows * _BLOCK, : columns * _BLOCK], rows, columns)
    order = np.argsort(-_measure_detail(blocks), kind="stable")
    rest = np.linspace(count // 2, order.size - 1, count - count // 2)
    chosen = blocks[order[[*range(count // 2), *rest.astype(int)]]]
    grid = chosen.reshape(_SIDE, _SIDE, _BLOCK, _BLOCK, 3).swapaxes(1, 2)
    return grid.reshape(_SIDE * _BLOCK, _SIDE * _BLOCK, 3)


def _split_blocks(picture: Array, rows: int, columns: int) -> Array:
    """(rows block, columns block, 3) -> (rows columns, block, block, 3)."""
    blocks = picture.reshape(rows, _BLOCK, columns, _BLOCK, 3).swapaxes(1, 2)
    return blocks.reshape(-1, _BLOCK, _BLOCK, 3)


def _measure_detail(blocks: Array) -> Array:
    """Return how much adjacent pixels differ in each block; one channel is enough."""
    return np.abs(np.diff(blocks[..., 1], axis=2)).mean(axis=(1, 2))


def _size_text(picture: Array) -> str:
    return f"{picture.shape[1]}x{picture.shape[0]}"
