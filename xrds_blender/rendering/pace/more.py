"""More samples of a frame of a shot, of all of it or of parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.local_filters import BLOCK
from xrds_core.accumulation.passes import Passes
from xrds_core.pace.extra_samples import enriched, mean_of, with_extra

from ...cycles.halves import more_samples
from ...cycles.low_resolution import Region
from ...planning.request import Request
from .. import stages
from ..sampling import Sampled, is_even, sampling_of


@dataclass(frozen=True)
class Part:
    """More samples of a frame: `length` of a sequence that has a number.

    With `begin` they are of one that all frames share, after so many taken of it. Where
    `at_once` is not 0 they are of several with so many: Cycles syncs the scene again
    for another number than it had before.

    Where the file has a noise threshold, pixels stop at `share` of what it asks for.
    `region` is a part of the picture, None all of it.
    """

    length: int
    share: float
    region: Region | None = None
    begin: int | None = None
    at_once: int = 0
    sequence: int = 1


More = Callable[[Part], tuple[dict[str, Passes], dict[str, float]]]
"""Renders more samples of a frame, by view, and says in how many seconds."""


def render_more(
    engine: Any, depsgraph: Any, request: Request, place: int | None, part: Part
) -> tuple[dict[str, Passes], dict[str, float]]:
    """Render more samples of the frame that the dependency graph is at.

    `place` is as in `sampling_of`. The result has the passes afterwards that it had
    before. Raises Cancelled when the user stops it.
    """
    how = sampling_of(engine, depsgraph, request, place)
    even = is_even(depsgraph.scene_eval, request)
    at_once = part.at_once if even else 0
    parts = how.further(part.length, part.begin, part.sequence, at_once)
    share = None if even else part.share
    stages.begin(engine, how.named(stages.SAMPLES), 1, 2)
    try:
        samples, seconds = more_samples(
            engine,
            depsgraph,
            parts,
            region=part.region,
            share=share,
            light=how.light,
        )
    finally:
        stages.end()
    return {v: mean_of([x[v] for x in samples]) for v in samples[0]}, seconds


class Extra(NamedTuple):
    """More samples of a region of a frame, by view."""

    region: Region
    views: dict[str, Passes]


def with_more(own: Sampled, extra: Sequence[Extra], weight: float) -> Sampled:
    """A frame with extra samples; beside them neighbours' count with a weight."""
    views, gathered = dict(own.views), dict(own.gathered)
    for region, by_view in extra:
        place = pixels_of(region)
        for view, more in by_view.items():
            alone = accumulate(views[view], [])
            gathered[view] = with_extra(gathered[view], alone, more, place, weight)
            views[view] = enriched(views[view], alone, more, place)
    return replace(own, views=views, gathered=gathered)


# Of a picture so much is measured in, but so many pixels, and half of it at most where
# strips are not narrower than two blocks.
_SHARE, _LEAST_AREA, _NARROWEST = 0.0625, 60_000, 2
# How far the middles of both strips lie from the picture's, in turn: in its width.
_OFFSETS = (0.25, 0.0, 0.375, 0.125)


def measured_regions(shape: tuple[int, int], turn: int = 0) -> list[Region]:
    """The parts of a picture (H, W) that show how large its errors are.

    Two strips from top to bottom, at other places each `turn`, as far left of the
    middle as right of it; all of a picture that these would cover.
    """
    height, width = shape
    across = _across(shape)
    if 2 * across >= width:
        return [whole_of(shape)]
    offset = max(round(_OFFSETS[turn % len(_OFFSETS)] * width), (across + 1) // 2)
    left = max(width // 2 - offset - across // 2, 0)
    right = width - left - across
    return [Region(x, 0, across, height) for x in (left, right)]


def _across(shape: tuple[int, int]) -> int:
    """How many pixels wide a strip of a picture (H, W) is."""
    height, width = shape
    area = max(_SHARE * height * width, _LEAST_AREA)
    wanted = math.ceil(area / (2 * height * BLOCK))
    return max(min(wanted, width // (4 * BLOCK)), _NARROWEST) * BLOCK


def whole_of(shape: tuple[int, int]) -> Region:
    """All of a picture (H, W)."""
    return Region(0, 0, shape[1], shape[0])


def measured_share(shape: tuple[int, int]) -> float:
    """What `measured_regions` are of a picture (H, W)."""
    return min(2 * _across(shape) / shape[1], 1.0)


def pixels_of(region: Region) -> tuple[slice, slice]:
    """Its rows and columns."""
    rows = slice(region.y, region.y + region.height)
    return rows, slice(region.x, region.x + region.width)
