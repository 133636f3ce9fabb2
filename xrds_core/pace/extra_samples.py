"""Samples that a frame gets beside its own, after its neighbours' were accumulated.

From then on they are the frame's own: other frames reuse them as well.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..accumulation.frame import pack, pack_counts, pack_parts
from ..accumulation.noise import brightness
from ..accumulation.passes import Passes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..accumulation.accumulate import Accumulated
    from ..accumulation.frame import Stored
    from ..arrays import Array


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


def enriched(frame: Stored, alone: Accumulated, extra: Passes) -> Stored:
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

    Returns
    -------
    enriched : Stored
    """
    combined = with_extra(alone, alone, extra)
    rows = _find_rows(_counts(extra))
    width = frame.shape[1]
    place = slice(rows.start * width, rows.stop * width)
    picture = frame.picture.copy()
    invalid = np.zeros(len(picture), bool)
    if frame.invalid is not None:
        invalid |= frame.invalid
    light, alpha = (
        None if x is None else x[rows] for x in (combined.radiance, combined.alpha)
    )
    guides = combined.albedo[rows], combined.normal[rows]
    picture[place], invalid[place] = pack(light, *guides, alpha)
    total = combined.samples
    is_even = bool((total == total.flat[0]).all())
    noise = frame.noise
    if noise is not None:
        assert extra.radiance is not None
        had = (alone.samples[rows] > 0.0).ravel().astype(np.float32)
        noise = noise.within(had, brightness(extra.radiance[rows]).ravel(), place)
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
    frame: Accumulated, alone: Accumulated, extra: Passes, worth: float = 1.0
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
    worth : float
        Value of a neighbour's sample relative to one of the frame's own.

    Returns
    -------
    combined : Accumulated
    """
    more = _counts(extra)
    rows = _find_rows(more)  # often few of many
    usable = np.isfinite(extra.picture[rows]).all(axis=-1) & (more[rows] > 0.0)
    for part in (extra.albedo, extra.normal):
        usable &= np.isfinite(part[rows]).all(axis=-1)
    neighbours = np.float32(worth)
    counts = (
        frame.samples[rows] * neighbours,
        alone.samples[rows] * (np.float32(1.0) - neighbours),
        np.where(usable, more[rows], np.float32(0.0)),
    )
    total = np.maximum(sum(counts), np.float32(1e-9))
    shares = [(count / total).astype(np.float32) for count in counts]

    def mean(*values: Array) -> Array:
        whole = values[0]
        wide = (...,) + (None,) * (whole.ndim - 2)
        mixed = np.zeros_like(whole[rows])
        for plane, share in zip(values, shares, strict=True):
            if share.any():
                # NaN where there are no samples
                mixed += np.where(share[wide] > 0.0, plane[rows], 0.0) * share[wide]
        return _replace_rows(whole, rows, np.where(usable[wide], mixed, whole[rows]))

    def mean_pass(name: str) -> Array | None:
        whole = getattr(frame, name)
        return (
            None
            if whole is None
            else mean(whole, *(getattr(samples, name) for samples in others))
        )

    others = alone, extra
    albedo, normal = mean_pass("albedo"), mean_pass("normal")
    assert albedo is not None
    assert normal is not None
    counted = np.where(usable, total, frame.samples[rows])
    return replace(
        frame,
        radiance=mean_pass("radiance"),
        albedo=albedo,
        normal=normal,
        alpha=mean_pass("alpha"),
        parts={
            name: mean(part, alone.parts[name], extra.parts[name])
            for name, part in frame.parts.items()
        },
        samples=_replace_rows(frame.samples, rows, counted),
    )


def _find_rows(samples: Array) -> slice:
    """Return the rows from the first to the last one with samples."""
    rows = np.flatnonzero(samples.any(axis=1))
    return slice(rows[0], rows[-1] + 1) if len(rows) else slice(0, 0)


def _replace_rows(whole: Array, rows: slice, values: Array) -> Array:
    result = whole.copy()
    result[rows] = values
    return result
