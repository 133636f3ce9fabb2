"""How much a moving picture flickers: the errors of what it shows, from frame to frame.

An eye follows what moves. So an error that moves along with a surface is a wrong
texture and no flicker; what counts is how errors change at places of the scene. The
change at a pixel, which is told more often, has both in it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from xrds_core.accumulation.reprojection import centres, reproject, reprojection

from .rivals import interpolated

if TYPE_CHECKING:
    from xrds_core.accumulation.frame import Stored
    from xrds_core.arrays import Array

    Pair = tuple[Array, Array]


def flicker(
    shown: Pair, truths: tuple[Pair, Pair], frames: tuple[Stored, Stored]
) -> float:
    """Return the root mean square change of errors along the camera's motion.

    Parameters
    ----------
    shown : tuple of (H, W, 3) arrays
        Display values of a frame and the next.
    truths : tuple of two pairs of (H, W, 3) arrays
        The same frames rendered twice with many samples, of independent noise and not
        denoised: the noise of one, which another would add to every error, is none of
        the other's.
    frames : tuple of Stored
        The same frames, of any samples: cameras and depths.

    Returns
    -------
    change : float
        In display values. Things that move by themselves are followed as if they stood
        still; what leaves the picture is left out.
    """
    x, y, inside = _positions(*frames)
    changes = [
        (interpolated(shown[1] - after, x, y) - (shown[0] - before))[inside]
        for before, after in truths
    ]
    return float(np.sqrt(max(np.mean(changes[0] * changes[1], dtype=np.float64), 0.0)))


def _positions(here: Stored, there: Stored) -> tuple[Array, Array, Array]:
    """Where the pixels (H, W) of a frame are in another, in steps from its first."""
    height, width = here.shape
    pixels = np.arange(height * width)
    x, y, _ = reproject(
        reprojection(here.camera, there.camera),
        *centres(pixels, width),
        here.inverse_depth,
    )
    x, y = (each.reshape(here.shape) - np.float32(0.5) for each in (x, y))
    with np.errstate(invalid="ignore"):  # behind the camera
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    return x, y, inside
