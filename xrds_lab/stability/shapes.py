"""Sizes and tiles: any picture, in any number of pieces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from xrds_core.superres.front_end import transfer

from .measured import Measured, faults
from .pictures import Inputs, blocks, textured

if TYPE_CHECKING:
    from collections.abc import Iterator

    from xrds_core.arrays import Array

    from .subject import Subject

# Full-resolution (height, width): tiny, prime, no multiple of scale or window, strips.
SIZES = (
    (1, 1), (1, 2), (2, 1), (2, 2), (1, 61), (61, 1), (7, 5), (13, 97), (65, 33),
    (64, 64), (16, 128), (128, 16),
)  # fmt: skip


def sizes(subject: Subject) -> Iterator[Measured]:
    """Every size gives a picture of that size without a fault."""
    bad = 0
    for height, width in SIZES:
        low = (-(-size // subject.scale) for size in (height, width))
        picture = subject(
            Inputs(
                blocks(*low), blocks(height, width, 1), 2 * blocks(height, width, 2) - 1
            )
        )
        bad += faults(picture) + (picture.shape != (height, width, 3))
    yield Measured("shapes.faults", bad)


def tiles(subject: Subject) -> Iterator[Measured]:
    """Smallest tiles against the whole picture, and the gradient across seams."""
    window = subject.upscaler.network.config.low_multiple
    low = (18 * window, 11 * window) if subject.thorough else (13 * window, 4 * window)
    scale = subject.scale
    inputs = textured(low[0] * scale, scale, width=low[1] * scale)
    whole = subject.upscaler(*inputs)
    tiled = subject(inputs, exposure=whole.exposure, tile=1)
    t, expected = (transfer(x, whole.exposure) for x in (tiled, whole.radiance))
    yield Measured("tiles.difference", float(np.abs(t - expected).max()))
    yield Measured("tiles.seam", _seam(t, expected))
    cut = 4 * window
    border = Inputs(inputs.radiance[cut:], *(x[cut * scale :] for x in inputs[1:]))
    part = transfer(subject(border, exposure=whole.exposure), whole.exposure)
    off = np.abs(part[cut * scale :] - expected[2 * cut * scale :])
    yield Measured("tiles.border", float(off.max()))


def _seam(t: Array, whole: Array) -> float:
    """Return the vertical gradient where tiles differ most, over the whole's there.

    Both in the transfer domain; rows far from every seam are equal.
    """
    rows = np.abs(t - whole).mean(axis=(1, 2))
    seams = rows[1:] >= np.quantile(rows, 0.9)
    tiled, plain = (np.abs(np.diff(x, axis=0)).mean(axis=(1, 2)) for x in (t, whole))
    return float(tiled[seams].mean() / plain[seams].mean())


CHECKS = (sizes, tiles)
