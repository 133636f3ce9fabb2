"""A frame of which nothing was rendered, in the place of one that takes from others.

Where its pixels lie is told by the frames beside it: their pixels are carried into its
camera, and the nearest surface that falls into a pixel is what it shows. That holds
where nothing moves but the camera.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .frame import Camera, Stored
from .motion import carry, grid, nearest, passage
from .neighbours import extreme

if TYPE_CHECKING:
    from collections.abc import Sequence


def stand_in(number: int, camera: Camera, beside: Sequence[Stored]) -> Stored:
    """Return a frame without samples, of the size and passes of those `beside` it.

    Its `nearness` is NaN where none of them shows what it shows. Orthographic cameras
    count depth in it, so there the least is the nearest.
    """
    first = beside[0]
    nearer = np.minimum if camera.orthographic else np.maximum
    near = np.full(first.nearness.shape, np.inf if camera.orthographic else -1.0)
    for each in beside:
        own = grid(each.shape)
        way = passage(each.camera, camera)
        x, y, carried = carry(way, own.x, own.y, each.nearness)
        found = nearest(x, y, first.shape)
        lies = found.seen & np.isfinite(carried)
        nearer.at(near, found.pixel[lies], carried[lies])
    near[~np.isfinite(near) | (near < 0.0)] = np.nan
    # pixels stretch where the camera comes nearer: what is beside fills the gaps
    around = extreme(near.reshape(first.shape).astype(np.float32), np.fmax).ravel()
    empty = np.ones(len(near), bool)
    return Stored(
        number=number,
        camera=camera,
        shape=first.shape,
        samples=first.samples,
        picture=np.zeros_like(first.picture),
        nearness=np.where(np.isnan(near), around, near).astype(np.float32),
        spoilt=empty,
        noise=None if first.noise is None else first.noise.without(empty),
    )
