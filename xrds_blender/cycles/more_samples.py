"""More samples of a frame, or of a part of it, beside those that it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from xrds_core.light_parts.find import LightPart
from xrds_core.temporal.sample_subsets import SampleSubset

from ..internals.borrowed import Borrowed
from . import session
from .halves import counted, seconds_of
from .low_camera import Region
from .passes import CyclesPasses
from .samples import COUNTS, Samples
from .settings import set_share


def more_samples(
    engine: Any,
    depsgraph: Any,
    parts: Sequence[SampleSubset],
    *,
    region: Region | None = None,
    share: float | None = None,
    light: Sequence[LightPart] = (),
) -> tuple[list[dict[str, Samples]], dict[str, float]]:
    """Render parts of sequences; samples of each by view, and the seconds.

    `region` is a part of the picture, in its own pixels; None is all of it. `share`
    keeps the file's noise threshold, as `set_share` has it, for each part.
    All samples have counts, and the parts of the `light`. The result has the passes
    afterwards that it had before. Raises Cancelled when the user stops it.
    """
    geometry = [] if share is None else [COUNTS]
    found, clocks = [], []
    with CyclesPasses(engine, depsgraph, geometry=geometry) as passes:
        whole, before = passes.region, passes.all_passes()
        region = region or Region(0, 0, whole.width, whole.height)
        place = Region(
            whole.x + region.x, whole.y + region.y, region.width, region.height
        )
        with Borrowed() as borrowed:
            if share is not None:
                scene = depsgraph.scene_eval
                set_share(borrowed, scene, session.samples_of(depsgraph), share)
            for part in parts:
                rendered, clock = passes.part_samples(
                    place, part, is_even=share is None, light=light
                )
                clocks.append(clock)
                found.append({v: _counted(x, part, clock) for v, x in rendered.items()})
        passes.put_back(before)
    return found, seconds_of(clocks)


def _counted(
    samples: Samples, part: SampleSubset, clock: session.StageClock
) -> Samples:
    """With the number of each pixel's samples, even ones as well."""
    found = counted(samples, part, clock)
    if found.counts is not None:
        return found
    counts = np.full(samples.picture.shape[:2], part.length, np.float32)
    return replace(samples, counts=counts)
