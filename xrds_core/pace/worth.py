"""The value of a neighbour: of its samples beside a frame's own, in a shot.

It is measured in the first frame, again in the first one beyond its neighbours, in the
20th, and then each time that the shot is three times as far: chance counts less and
less, and the seconds of measuring are a small part of the shot's. Where a small picture
shows more chance than anything else, what other shots have shown counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ..arrays import Array

_SOON = 20  # frames; one of those before has all its neighbours
# What is known before anything is measured: mean and standard deviation over the
# choosing half of the gallery, 4 samples with neighbours against 16 without.
_USUAL, _SPREAD = 0.45, 0.25
# No ratio is better known than this, relative to it: errors do not fall quite with
# `FALL`, nor does every measure of them see the same.
_EXACT = 0.06
_CAUTION = 0.16  # probability of a lower value: the mean less its standard error
FALL = 0.7
"""The error of a denoised picture falls with about this power of its samples."""
_STEPS = np.linspace(0.0, 1.0, 201)
_TINY = 1e-30


class Errors(NamedTuple):
    """Squared errors, by blocks; single ones may be negative, where noise hides them.

    Attributes
    ----------
    fewer : (n,) array
        Of fewer samples with neighbours.
    all : (n,) array
        Of all samples without.
    """

    fewer: Array
    all: Array

    @property
    def ratio(self) -> float:
        """Error of fewer samples over that of all; infinite where noise hides it."""
        whole = float(self.all.sum())
        return max(float(self.fewer.sum()), 0.0) / whole if whole > 0.0 else np.inf

    def misfit(self, ratio: Array) -> Array:
        """Return by how many standard errors each of some ratios is off.

        Neither error need be known for that: blocks that are hard to render are so both
        ways, and what is left says how much is chance.
        """
        fewer, whole = self.fewer.astype(np.float64), self.all.astype(np.float64)
        left = fewer - ratio[:, None] * whole
        chance = left.std(axis=1) * np.sqrt(len(whole))
        inexact = _EXACT * ratio * max(float(whole.sum()), 0.0)
        return np.asarray(
            left.sum(axis=1) / np.maximum(np.hypot(chance, inexact), _TINY)
        )


@dataclass
class Worth:
    """The value, from 0 to 1, of the samples of neighbours in one shot."""

    _misfit: Array = field(default_factory=lambda: np.zeros_like(_STEPS))
    _neighbours: int = 0
    _frames: int = 0
    _next: int = 1

    def is_due(self, neighbours: int) -> bool:
        """Count a frame; return whether it is to be measured in."""
        self._frames += 1
        more = neighbours >= 2 * max(self._neighbours, 1)
        return self._frames >= self._next or more

    @property
    def is_old(self) -> bool:
        """Whether enough frames were counted to measure anew where a shot changes."""
        return self._frames >= _SOON

    def add(self, errors: Errors, share: float, gain: float, neighbours: int) -> None:
        """Add the measurement of a frame.

        Where a frame has few neighbours these lie on one side only and are less
        valuable: earlier measurements with fewer neighbours are dropped.

        Parameters
        ----------
        errors : Errors
            Of the frame with its neighbours, and of one of all samples.
        share : float
            Share of all samples that the frame has.
        gain : float
            How many times its own samples the frame has with its neighbours.
        neighbours : int
            How many neighbours it has.
        """
        if neighbours > self._neighbours:
            self._misfit[:] = 0.0
        self._neighbours = neighbours
        self._next = max(3 * self._frames, _SOON)
        expected = (share * (1.0 + (gain - 1.0) * _STEPS)) ** -FALL
        self._misfit += np.square(errors.misfit(expected))

    @property
    def value(self) -> float:
        """A cautious estimate: that of other shots where noise hides all errors."""
        usual = np.square((_STEPS - _USUAL) / _SPREAD)
        logarithms = -0.5 * (usual + self._misfit)
        below = np.cumsum(np.exp(logarithms - logarithms.max()))
        return float(np.interp(_CAUTION, below / below[-1], _STEPS))
