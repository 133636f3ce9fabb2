"""How large the error of a frame with its neighbours is, measured as it is rendered."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.pace.error import Rendered, measure_errors
from xrds_core.pace.extra_samples import mean_of
from xrds_core.pace.worth import Errors

from ..methods import Finishing
from ..sampling import Sampled
from .more import (
    Extra,
    Part,
    measured_regions,
    measured_share,
    pixels_of,
    whole_of,
)

Render = Callable[[Part], dict[str, Passes]]
"""Renders more samples of a frame, by view."""


def price_of_measuring(shape: tuple[int, int]) -> float:
    """What measuring in a frame (H, W) takes, in frames of all samples."""
    return 2.0 * measured_share(shape)


class Measured(NamedTuple):
    """What was measured in some regions of a frame, and the samples that it took.

    `errors` are those of its picture, of one of all samples and of its own alone, both
    as by Cycles, which takes so many seconds for `denoising` a frame of this size.
    `asked` (H, W) are the samples that the file takes, 0 elsewhere.
    """

    errors: Errors
    extra: list[Extra]
    denoising: float
    asked: Array


def measure(
    method: Finishing,
    own: Sampled,
    others: Sequence[Sampled],
    samples: int,
    exposure: float,
    turn: int,
    more: Render,
) -> Measured:
    """Compare an accumulated frame with one of all `samples` without neighbours.

    In `measured_regions` of a `turn`, by two renders of all samples each, of two seeds.
    Renders of half of them would not do: where texture is fine one sequence of all is
    far better than two of half as many. Nor would our own denoiser: it is quicker than
    Cycles' and blurs fine albedo more. White is a luminance of 1 / `exposure`.
    """
    view = next(iter(own.views))
    shape = own.views[view].shape
    regions = measured_regions(shape, turn)
    cells: list[list[Rendered]] = []
    seconds = 0.0
    extra: list[Extra] = []
    asked = np.zeros(shape, np.float32)
    for region in regions:
        place = None if region == whole_of(shape) else region
        pair = [more(Part(samples, 1.0, place, sequence=-i)) for i in (1, 2)]
        made = [_rendered(method, one[view]) for one in pair]
        cells.append([rendered for rendered, _ in made])
        # the first of a size makes the denoiser ready for it
        seconds += min(taken for _, taken in made)
        views = {name: mean_of([one[name] for one in pair]) for name in own.views}
        extra.append(Extra(region, views))
        both = views[view].counts
        assert both is not None
        asked[pixels_of(region)] = both / 2
    parts = _joined([one for one, _ in cells]), _joined([two for _, two in cells])
    # with the neighbours' samples: what may be wrong in them has nothing to do with
    # what denoising takes, and the frame's own few are far noisier
    noisy = own.gathered[view].radiance
    assert noisy is not None
    places = [pixels_of(region) for region in regions]
    # each part by itself, as the renders of all samples are
    together = np.concatenate([method.radiance(own, others, view, x) for x in places])
    # of stereo, the other eye is a neighbour as well
    by_itself = replace(own, views={view: own.views[view]})
    single = method.accumulate(by_itself, [], view)
    assert single.radiance is not None
    guided = single.radiance, single.albedo, single.normal
    alone = [method.as_by_cycles(*(x[place] for x in guided)) for place in places]
    around = np.concatenate([noisy[place] for place in places])
    errors = measure_errors(together, np.concatenate(alone), around, parts, exposure)
    return Measured(errors, extra, seconds / measured_share(shape), asked)


def _rendered(method: Finishing, samples: Passes) -> tuple[Rendered, float]:
    """Samples as rendered and denoised, and the seconds of denoising them."""
    radiance = samples.radiance
    assert radiance is not None
    started = time.perf_counter()
    denoised = method.as_by_cycles(radiance, samples.albedo, samples.normal)
    return Rendered(radiance, denoised), time.perf_counter() - started


def _joined(cells: Sequence[Rendered]) -> Rendered:
    """One picture of several, one below the other."""
    return Rendered(
        np.concatenate([x.noisy for x in cells]),
        np.concatenate([x.denoised for x in cells]),
    )
