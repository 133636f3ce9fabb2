"""Figures of what mirrors and glass show, apart from the rest of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.reprojection import pair
from xrds_core.accumulation.virtual_images import find_images
from xrds_core.arrays import Array

from ..metrics import squared_error, to_srgb
from .judge import BARE


def figures(
    own: Stored,
    others: Sequence[Stored],
    pictures: Sequence[Array],
    references: Sequence[Array],
) -> dict[str, Any]:
    """Gains in dB over the frame alone on the pixels that show images.

    `pictures` are the frame alone, with its neighbours `others` found by surfaces, and
    with these found by images.
    `surface_gain` is that of neighbours found by their surfaces; `followed_share` of
    these pixels are found by their image, `moved_share` by one that moves by itself.
    """
    assert own.image is not None
    shown = ~np.isnan(own.image).reshape(own.shape)
    truth = [to_srgb(each[..., :3]) for each in references]

    def error(picture: Array) -> float:
        found = squared_error(to_srgb(picture[..., :3]), truth)[shown]
        return max(float(found.mean()), BARE)

    alone, *errors = map(error, pictures)
    gains = dict(zip(("surface_gain", "image_gain"), errors, strict=True))
    found = find_images(own, [pair(own, other) for other in others])
    motion = np.zeros((0, 3)) if found is None else found.lattice.reshape(-1, 3)
    motion = motion[~np.isnan(motion[:, 0])]
    spots = shown.sum() / (1 if found is None else found.stride**2)
    return {
        "image_share": round(float(shown.mean()), 4),
        "image_psnr_alone": round(-10 * float(np.log10(alone)), 4),
        **{k: round(10 * float(np.log10(alone / x)), 4) for k, x in gains.items()},
        "followed_share": round(min(1.0, len(motion) / spots), 4),
        "moved_share": round(
            min(1.0, float(motion[:, 1:].any(axis=1).sum()) / spots), 4
        ),
    }
