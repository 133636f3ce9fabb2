"""How large the error of a frame with its neighbours is, measured as it is rendered."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.pace.error import Rendered, measure_errors
from xrds_core.pace.extra_samples import mean_of
from xrds_core.pace.worth import Errors

from ..methods import Finishing
from ..sampling import Sampled
from .more import Extra, Part, measured_regions, pixels_of
from .threshold import counts_of_file

Render = Callable[[Part], dict[str, Passes]]
"""Renders more samples of a frame, by view."""


class Measured(NamedTuple):
    """What was measured in some regions of a frame, and the samples that it took.

    `errors` are those of its picture and of one of all samples; denoising a frame of
    this size by itself takes so many seconds. `asked` (H, W) are the samples that the
    file takes, 0 elsewhere.
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
    more: Render,
    least: int | None = None,
) -> Measured:
    """Compare an accumulated frame with one of all `samples` without neighbours.

    In `measured_regions`, by two renders of half of the samples each, of two seeds:
    halves of one sequence would not be independent. White is a luminance of 1 /
    `exposure`. Under a noise threshold a pixel takes at `least` so many.
    """
    view, length = next(iter(own.views)), max(1, samples // 2)
    shape = own.views[view].shape
    regions = measured_regions(shape)
    cells: list[list[Rendered]] = []
    seconds = 0.0
    extra: list[Extra] = []
    both = np.zeros(shape, np.float32)
    for region in regions:
        place = None if (region.height, region.width) == shape else region
        halves = [more(Part(length, 0.5, place, sequence=-i)) for i in (1, 2)]
        started = time.perf_counter()
        cells.append([_rendered(method, half[view]) for half in halves])
        seconds += time.perf_counter() - started
        views = {name: mean_of([half[name] for half in halves]) for name in own.views}
        extra.append(Extra(region, views))
        both[pixels_of(region)] = views[view].counts
    parts = _joined([one for one, _ in cells]), _joined([two for _, two in cells])
    area = sum(region.width * region.height for region in regions)
    # with the neighbours' samples: what may be wrong in them has nothing to do with
    # what denoising takes, and the frame's own few are far noisier
    noisy = own.gathered[view].radiance
    assert noisy is not None
    places = [pixels_of(region) for region in regions]
    # a part by itself, as its halves are
    together = [method.radiance(own, others, view, place) for place in places]
    asked = both if least is None else counts_of_file(both, least, samples)
    asked = np.where(both > 0.0, asked, np.float32(0.0))
    errors = measure_errors(
        np.concatenate(together),
        np.concatenate([noisy[place] for place in places]),
        parts,
        exposure,
        float(both.sum() / 2 / asked.sum()),
    )
    denoising = seconds / 2 * shape[0] * shape[1] / area
    return Measured(errors, extra, denoising, asked)


def _rendered(method: Finishing, samples: Passes) -> Rendered:
    radiance = samples.radiance
    assert radiance is not None
    return Rendered(radiance, method.denoised(radiance, samples.albedo, samples.normal))


def _joined(cells: Sequence[Rendered]) -> Rendered:
    """One picture of several, one below the other."""
    return Rendered(
        np.concatenate([x.noisy for x in cells]),
        np.concatenate([x.denoised for x in cells]),
    )
