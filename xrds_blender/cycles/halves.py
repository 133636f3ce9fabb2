"""Two halves of a frame's samples out of one kept Cycles session.

They are two parts of one sample sequence, so their mean is what one render of all
samples gives, and the scene is synced once. The result then holds the means of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.temporal.halves import Halves
from xrds_core.temporal.samples import Portion

from . import session
from .clock import StageClock
from .layer_session import LayerSession
from .pass_names import is_of_first_sample
from .samples import GEOMETRY, Samples, sample_layer

_Passes = dict[tuple[str, str], Array]
_Geometry = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Half:
    """One view as `Samples`, and the halves that it is the mean of."""

    whole: Samples
    halves: Halves


def sample_halves(
    engine: Any, depsgraph: Any, portion: Portion, geometry: _Geometry
) -> tuple[dict[str, Half], dict[str, float]]:
    """Render a part of a sequence, of two samples or more, in two halves.

    Returns them by view, and the seconds: sync, beauty. `geometry` is as in
    `sample_layer`. Raises Cancelled when the user stops it.
    """
    with LayerSession(engine, depsgraph) as layer:
        parts, passes, clocks = [], [], []
        for part in portion.halves():
            samples, clock = sample_layer(
                engine, depsgraph, portion=part, geometry=geometry
            )
            parts.append(samples)
            passes.append(layer.all_passes())
            clocks.append(clock)
        shares = portion.shares()
        layer.put_back(_merged(*passes, shares))
    found = {
        view: _joined(first, parts[1][view], shares) for view, first in parts[0].items()
    }
    return found, _seconds(clocks)


def sample_motion(
    engine: Any, depsgraph: Any, seed: int
) -> tuple[dict[str, Samples], dict[str, float]]:
    """Render depth and motion at the middle of the shutter: one sample, no blur.

    Cycles gives no vectors with motion blur. Returns as `sample_halves`; the result
    then holds other passes than the frame's own.
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
    return samples, _seconds([clock])


def _seconds(clocks: Sequence[StageClock]) -> dict[str, float]:
    return {
        "sync": sum(clock.sync for clock in clocks),
        "beauty": sum(clock.render for clock in clocks),
    }


def _joined(first: Samples, second: Samples, shares: tuple[float, float]) -> Half:
    pictures = np.stack((first.picture, second.picture))
    halves = Halves(
        radiance=pictures[..., :3],
        albedo=np.stack((first.albedo, second.albedo)),
        normal=np.stack((first.normal, second.normal)),
        alpha=pictures[..., 3],
        shares=shares,
    )
    radiance, alpha = halves.mean("radiance"), halves.mean("alpha")
    whole = replace(
        first,
        picture=np.dstack((radiance, alpha)),
        albedo=halves.mean("albedo"),
        normal=halves.mean("normal"),
    )
    return Half(whole, halves)


def _merged(first: _Passes, second: _Passes, shares: tuple[float, float]) -> _Passes:
    """Passes of all samples: means, but for what only a first sample writes."""
    one, two = (np.float32(share) for share in shares)
    return {
        key: pixels
        if is_of_first_sample(key[1]) or key not in second
        else pixels * one + second[key] * two
        for key, pixels in first.items()
    }
