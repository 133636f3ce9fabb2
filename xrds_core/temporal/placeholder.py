"""A reprojected placeholder for a frame that was not rendered, to accumulate on.

Its geometry comes from adjacent frames: their pixels are reprojected into its camera,
and the nearest surface that falls into a pixel is what it shows. This holds where
nothing moves but the camera.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .frame import Camera, Stored
from .local_filters import extreme
from .motion import grid, nearest, reproject, reprojection

if TYPE_CHECKING:
    from collections.abc import Sequence


def reprojected_placeholder(
    number: int, camera: Camera, beside: Sequence[Stored]
) -> Stored:
    """Return a frame without samples, of the size and passes of the frames `beside` it.

    Its `inverse_depth` is NaN where none of them shows what it shows. Of orthographic
    cameras that is the depth, so the smallest value is the nearest.
    """
    first = beside[0]
    nearer = np.minimum if camera.orthographic else np.maximum
    near = np.full(first.inverse_depth.shape, np.inf if camera.orthographic else -1.0)
    for each in beside:
        own = grid(each.shape)
        transform = reprojection(each.camera, camera)
        x, y, reprojected = reproject(transform, own.x, own.y, each.inverse_depth)
        found = nearest(x, y, first.shape)
        lies = found.seen & np.isfinite(reprojected)
        nearer.at(near, found.pixel[lies], reprojected[lies])
    near[~np.isfinite(near) | (near < 0.0)] = np.nan
    # pixels stretch where the camera comes nearer: adjacent pixels fill the gaps
    around = extreme(near.reshape(first.shape).astype(np.float32), np.fmax).ravel()
    empty = np.ones(len(near), bool)
    return Stored(
        number=number,
        camera=camera,
        shape=first.shape,
        samples=first.samples,
        picture=np.zeros_like(first.picture),
        parts=dict.fromkeys(first.parts),
        inverse_depth=np.where(np.isnan(near), around, near).astype(np.float32),
        invalid=empty,
        noise=None if first.noise is None else first.noise.without(empty),
    )
