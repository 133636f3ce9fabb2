"""Samples that a frame gets beside its own, after its neighbours' were accumulated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..arrays import Array
    from ..temporal.accumulate import Accumulated


@dataclass(frozen=True)
class ExtraSamples:
    """Means over `samples` (H, W) more samples per pixel, 0 where there are none.

    `radiance`, `albedo` and `normal` (H, W, 3) and `alpha` (H, W) are as in `Frame`.
    Beside them a neighbour's sample counts as `worth` of the frame's own.
    """

    radiance: Array
    albedo: Array
    normal: Array
    alpha: Array
    samples: Array
    worth: float = 1.0


def with_extra(
    frame: Accumulated, alone: Accumulated, extra: ExtraSamples
) -> Accumulated:
    """Return a frame with extra samples; itself where these are not finite.

    `alone` is the frame without its neighbours.
    """
    usable = np.isfinite(extra.alpha) & (extra.samples > 0.0)
    for part in (extra.radiance, extra.albedo, extra.normal):
        usable &= np.isfinite(part).all(axis=-1)
    worth = np.float32(extra.worth)
    counts = (
        frame.samples * worth,
        alone.samples * (np.float32(1.0) - worth),
        np.where(usable, extra.samples, np.float32(0.0)),
    )
    total = np.maximum(sum(counts), np.float32(1e-9))
    shares = [(count / total).astype(np.float32) for count in counts]

    def mean(name: str) -> Array | None:
        whole = getattr(frame, name)
        if whole is None:
            return None
        wide = (...,) + (None,) * (whole.ndim - 2)
        mixed = np.zeros_like(whole)
        for each, share in zip((frame, alone, extra), shares, strict=True):
            values = getattr(each, name)
            # NaN where there are no samples
            mixed += np.where(share[wide] > 0.0, values, 0.0) * share[wide]
        return np.where(usable[wide], mixed, whole)

    albedo, normal = mean("albedo"), mean("normal")
    assert albedo is not None
    assert normal is not None
    return replace(
        frame,
        radiance=mean("radiance"),
        albedo=albedo,
        normal=normal,
        alpha=mean("alpha"),
        samples=np.where(usable, total, frame.samples).astype(np.float32),
    )
