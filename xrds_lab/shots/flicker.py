"""How much a moving picture flickers: the errors of what it shows, from frame to frame.

An eye follows what moves. So an error that moves along with a surface is a wrong
texture and no flicker; what counts is how errors change at places of the scene. The
change at a pixel, which is told more often, has both in it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .rivals import displaced, interpolated

if TYPE_CHECKING:
    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

    Pair = tuple[Array, Array]


def flicker(
    shown: Pair, truths: tuple[Pair, Pair], frames: tuple[Frame, Frame]
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
    frames : tuple of Frame
        The same frames, of any samples: cameras, depths and, where things move, the
        Vector pass.

    Returns
    -------
    change : float
        In display values; what leaves the picture is left out.
    """
    x, y = displaced(*frames)
    height, width = frames[0].shape
    with np.errstate(invalid="ignore"):  # behind the camera
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    changes = [
        (interpolated(shown[1] - after, x, y) - (shown[0] - before))[inside]
        for before, after in truths
    ]
    return float(np.sqrt(max(np.mean(changes[0] * changes[1], dtype=np.float64), 0.0)))
