"""Samples that a frame gets beside its own, after its neighbours' were accumulated.

From then on they are the frame's own: other frames reuse them as well.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accumulation.frame import pack, pack_counts, pack_parts
from ..accumulation.noise import brightness
from ..accumulation.passes import Passes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..accumulation.accumulate import Accumulated
    from ..accumulation.frame import Stored
    from ..arrays import Array
    from ..finish import Rectangle


def mean_of(several: Sequence[Passes]) -> Passes:
    """Return the mean of several, weighted by their counts, which add up.

    Radiance, alpha, albedo, normal, counts and parts; no other passes.
    """
    counts = [_counts(each) for each in several]
    total = np.sum(counts, axis=0)
    weights = [count / np.maximum(total, np.float32(1e-9)) for count in counts]

    def mean(values: Sequence[Array]) -> Array:
        wide = (...,) + (None,) * (values[0].ndim - 2)
        pairs = zip(values, weights, strict=True)
        return np.sum([x * w[wide] for x, w in pairs], axis=0)

    names = ("radiance", "albedo", "normal", "alpha")
    means = {name: mean([getattr(x, name) for x in several]) for name in names}
    parts = {k: mean([x.parts[k] for x in several]) for k in several[0].parts}
    return Passes(**means, counts=total, parts=parts)


def _counts(extra: Passes) -> Array:
    assert extra.counts is not None
    return extra.counts


def enriched(
    frame: Stored, alone: Accumulated, extra: Passes, place: Rectangle
) -> Stored:
    """Return a frame whose own samples include extra ones.

    `noise` stays that of the samples which the frame had: the mean root of more samples
    is larger, and would be other light beside frames that have fewer.

    Parameters
    ----------
    frame : Stored
        The frame as rendered.
    alone : Accumulated
        The frame as accumulated without neighbours.
    extra : Passes
        Its extra samples.
    place : tuple of slice
        The rows and columns that these are of.

    Returns
    -------
    enriched : Stored
    """
    combined = with_extra(alone, alone, extra, place)
    height, width = frame.shape
    pixels = np.arange(height * width).reshape(height, width)[place].ravel()
    picture = frame.picture.copy()
    invalid = np.zeros(len(picture), bool)
    if frame.invalid is not None:
        invalid |= frame.invalid
    light, alpha = (
        None if x is None else x[place] for x in (combined.radiance, combined.alpha)
    )
    guides = combined.albedo[place], combined.normal[place]
    picture[pixels], invalid[pixels] = pack(light, *guides, alpha)
    total = combined.samples
    is_even = bool((total == total.flat[0]).all())
    noise = frame.noise
    if noise is not None:
        assert extra.radiance is not None
        had = (alone.samples[place] > 0.0).ravel().astype(np.float32)
        noise = noise.within(had, brightness(extra.radiance).ravel(), pixels)
    return replace(
        frame,
        samples=max(float(total.mean()), 1e-9),
        counts=None if is_even else pack_counts(total),
        picture=picture,
        invalid=invalid if invalid.any() else None,
        noise=noise,
        parts=pack_parts(combined.parts),
    )


def with_extra(
    frame: Accumulated,
    alone: Accumulated,
    extra: Passes,
    place: Rectangle,
    worth: float = 1.0,
) -> Accumulated:
    """Return an accumulated frame with extra samples, where these are finite.

    Parameters
    ----------
    frame : Accumulated
        The frame with the samples of its neighbours.
    alone : Accumulated
        The frame without them.
    extra : Passes
        Its extra samples.
    place : tuple of slice
        The rows and columns that these are of.
    worth : float
        Value of a neighbour's sample relative to one of the frame's own.

    Returns
    -------
    combined : Accumulated
    """
    more = _counts(extra)
    usable = np.isfinite(extra.picture).all(axis=-1) & (more > 0.0)
    for guide in (extra.albedo, extra.normal):
        usable &= np.isfinite(guide).all(axis=-1)
    neighbours = np.float32(worth)
    counts = (
        frame.samples[place] * neighbours,
        alone.samples[place] * (np.float32(1.0) - neighbours),
        np.where(usable, more, np.float32(0.0)),
    )
    total = np.maximum(sum(counts), np.float32(1e-9))
    shares = [(count / total).astype(np.float32) for count in counts]

    def mean(whole: Array, own: Array, added: Array) -> Array:
        wide = (...,) + (None,) * (whole.ndim - 2)
        mixed = np.zeros_like(added)
        for plane, share in zip((whole[place], own[place], added), shares, strict=True):
            # NaN where there are no samples
            mixed += np.where(share[wide] > 0.0, plane, 0.0) * share[wide]
        return _replaced(whole, place, np.where(usable[wide], mixed, whole[place]))

    def mean_pass(name: str) -> Any:
        whole = getattr(frame, name)
        if whole is None:
            return None
        return mean(whole, getattr(alone, name), getattr(extra, name))

    counted = np.where(usable, total, frame.samples[place])
    return replace(
        frame,
        **{name: mean_pass(name) for name in ("radiance", "albedo", "normal", "alpha")},
        parts={
            name: mean(part, alone.parts[name], extra.parts[name])
            for name, part in frame.parts.items()
        },
        samples=_replaced(frame.samples, place, counted),
    )


def _replaced(whole: Array, place: Rectangle, values: Array) -> Array:
    result = whole.copy()
    result[place] = values
    return result
