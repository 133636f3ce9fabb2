"""Two halves of a frame's samples out of one Cycles session.

They are two parts of one sample sequence, so their mean is what one render of all
samples gives, and the scene is synced once. Where a noise threshold may stop a pixel
they are two sequences: it stops later in a part of one. The result then holds the means
of both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from xrds_core.accumulation.frame import Halves
from xrds_core.accumulation.passes import Passes, weighted_mean
from xrds_core.accumulation.sample_subsets import SampleSubset
from xrds_core.arrays import Array
from xrds_core.denoising.light_passes import LightPart, passes_by_name

from ..internals.borrowed import Borrowed
from . import live, session
from .layer_session import LayerSession
from .low_resolution import Region
from .passes import CyclesPasses
from .samples import (
    COUNTS,
    GEOMETRY,
    Reader,
    read_samples,
    render_once,
    sample_layer,
)
from .session import StageClock
from .settings import SAMPLE_COUNT, first_look, is_of_first_sample, set_share

_Named = dict[tuple[str, str], Array]
_Geometry = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Half:
    """One view, and the light of the halves that it is the mean of."""

    whole: Passes
    halves: Halves


def sample_halves(
    engine: Any,
    depsgraph: Any,
    subset: SampleSubset,
    geometry: _Geometry,
    light: Sequence[LightPart] = (),
) -> tuple[dict[str, Half], dict[str, float]]:
    """Render a part of a sequence in two halves.

    Parameters
    ----------
    engine : bpy.types.RenderEngine
        The engine that renders.
    depsgraph : bpy.types.Depsgraph
        The evaluated scene.
    subset : SampleSubset
        The part, of two samples or more.
    geometry : sequence of (str, str)
        Those of GEOMETRY that are wanted, or LATE_DEPTH, and COUNTS. With COUNTS the
        file's noise threshold is kept, and counts are in samples.
    light : sequence of LightPart
        AOVs and light passes that are wanted.

    Returns
    -------
    halves : dict of str to Half
        By view.
    seconds : dict of str to float
        By stage: sync, beauty.

    Raises
    ------
    Cancelled
        If the user stops it.
    """
    is_even = COUNTS not in geometry
    names = {name for name, _ in geometry}
    parts, passes, clocks = [], [], []
    with LayerSession(engine, depsgraph) as layer, Borrowed() as borrowed:
        halves = subset.halves()
        if not is_even:  # so that their mean has the noise that is asked for
            scene = depsgraph.scene_eval
            set_share(borrowed, scene, subset.whole, 0.5)
            if halves[0].length > first_look(scene.cycles.adaptive_min_samples):
                halves = subset.sequences()
        for part in halves:
            clock = render_once(
                engine,
                depsgraph,
                noisy=True,
                subset=part,
                is_even=is_even,
                geometry=geometry,
            )
            found = layer.all_passes()
            samples = {
                view: read_samples(_reader(found, view), names, light)
                for view in layer.views
            }
            live.show(samples[layer.views[0]].picture)
            parts.append({v: counted(x, part, clock) for v, x in samples.items()})
            passes.append(found)
            clocks.append(clock)
        shares = subset.shares()
        by_view = {
            view: _join_halves(first, parts[1][view], shares)
            for view, first in parts[0].items()
        }
        first, second = passes
        layer.put_back(
            _merge_passes(first, second, shares, by_view)
            | _light_passes(light, by_view)
        )
    return by_view, seconds_of(clocks)


def _reader(passes: _Named, view: str) -> Reader:
    """Pixels of a view's passes, each of which is read of the result once."""
    return lambda name: passes.get((view, name))


def counted(samples: Passes, part: SampleSubset, clock: StageClock) -> Passes:
    """With the number of each pixel's samples in the place of its share of the most."""
    if samples.counts is None:
        return samples
    # fewer where Cycles stopped before the most it was allowed
    most = min(clock.samples, part.length) if clock.samples else part.length
    return replace(samples, counts=samples.counts * np.float32(most))


def sample_motion(
    engine: Any, depsgraph: Any, seed: int
) -> tuple[dict[str, Passes], dict[str, float]]:
    """Render depth and motion at the middle of the shutter: one sample, no blur.

    Cycles gives no vectors with motion blur. Returns the samples by view, and the
    seconds by stage; the result then holds other passes than the frame's own.
    """
    with LayerSession(engine, depsgraph) as layer:
        layer.hold_still()
        # what is synced without blur is of no use to a render with it, or the reverse
        session.free(engine)
        try:
            samples, clock = sample_layer(
                engine, depsgraph, samples=1, seed=seed, geometry=GEOMETRY
            )
        finally:
            session.free(engine)
    return samples, seconds_of([clock])


def seconds_of(clocks: Sequence[StageClock]) -> dict[str, float]:
    """By stage, of several renders."""
    return {
        "sync": sum(clock.sync for clock in clocks),
        "beauty": sum(clock.render for clock in clocks),
    }


def _join_halves(first: Passes, second: Passes, shares: tuple[float, float]) -> Half:
    halves = Halves.of(first, second, shares)
    return Half(first.joined(second, halves.share()), halves)


def _light_passes(parts: Sequence[LightPart], by_view: Mapping[str, Half]) -> _Named:
    """The light passes: those that are divided by a colour have no plain means."""
    return {
        (view, name): pixels
        for view, half in by_view.items()
        for name, pixels in passes_by_name(parts, half.whole.parts).items()
    }


def _merge_passes(
    first: _Named,
    second: _Named,
    shares: tuple[float, float],
    by_view: Mapping[str, Half],
) -> _Named:
    """Passes of all samples: means, but for what only a first sample writes."""
    merged = {}
    for (view, name), pixels in first.items():
        if is_of_first_sample(name) or (view, name) not in second:
            merged[view, name] = pixels
            continue
        share = by_view[view].halves.share()
        if name == SAMPLE_COUNT:  # itself a share, of the most samples
            share = np.asarray(shares[0], np.float32)
        merged[view, name] = weighted_mean(pixels, second[view, name], share)
    return merged


def more_samples(
    engine: Any,
    depsgraph: Any,
    parts: Sequence[SampleSubset],
    *,
    region: Region | None = None,
    share: float | None = None,
    light: Sequence[LightPart] = (),
) -> tuple[list[dict[str, Passes]], dict[str, float]]:
    """Render parts of sequences; the result keeps the passes that it had before.

    Parameters
    ----------
    engine : bpy.types.RenderEngine
        The engine that renders.
    depsgraph : bpy.types.Depsgraph
        The evaluated scene.
    parts : sequence of SampleSubset
        Parts of sequences.
    region : Region, optional
        A part of the picture, in its own pixels; all of it by default.
    share : float, optional
        Keeps the file's noise threshold for each part: a pixel stops at this share of
        what the threshold asks for.
    light : sequence of LightPart
        AOVs and light passes that are wanted.

    Returns
    -------
    samples : list of dict of str to Passes
        Samples of each part by view, with counts.
    seconds : dict of str to float
        By stage: sync, beauty.

    Raises
    ------
    Cancelled
        If the user stops it.
    """
    geometry = [] if share is None else [COUNTS]
    rendered_parts, clocks = [], []
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
                rendered_parts.append(
                    {v: _add_counts(x, part, clock) for v, x in rendered.items()}
                )
        passes.put_back(before)
    return rendered_parts, seconds_of(clocks)


def _add_counts(
    samples: Passes, part: SampleSubset, clock: session.StageClock
) -> Passes:
    """With the number of each pixel's samples, even ones as well."""
    with_counts = counted(samples, part, clock)
    if with_counts.counts is not None:
        return with_counts
    counts = np.full(samples.shape, part.length, np.float32)
    return replace(samples, counts=counts)
