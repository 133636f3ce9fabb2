"""The value of a neighbour: of its samples beside a frame's own, in a shot.

It is measured in the first frame, again in the first one beyond its neighbours, in the
20th, and then each time that the shot is three times as far: chance counts less and
less, and the seconds of measuring are a small part of the shot's. Where a small picture
shows more chance than anything else, what other shots have shown counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

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


class Ratio(NamedTuple):
    """The squared error of fewer samples with neighbours over that of all without.

    Attributes
    ----------
    value : float
        The ratio.
    spread : float
        Its standard error.
    """

    value: float
    spread: float


@dataclass
class Worth:
    """The value, from 0 to 1, of the samples of neighbours in one shot."""

    _likelihoods: list[np.ndarray] = field(default_factory=list)
    _neighbours: int = 0
    _frames: int = 0
    _next: int = 1

    def is_due(self, neighbours: int) -> bool:
        """Count a frame; return whether it is to be measured in."""
        self._frames += 1
        more = neighbours >= 2 * max(self._neighbours, 1)
        return self._frames >= self._next or more

    def add(self, ratio: Ratio, share: float, gain: float, neighbours: int) -> None:
        """Add the measurement of a frame.

        Where a frame has few neighbours these lie on one side only and are less
        valuable: earlier measurements with fewer neighbours are dropped.

        Parameters
        ----------
        ratio : Ratio
            Squared error of the frame with its neighbours over that of one of all
            samples.
        share : float
            Share of all samples that the frame has.
        gain : float
            How many times its own samples the frame has with its neighbours.
        neighbours : int
            How many neighbours it has.
        """
        if neighbours > self._neighbours:
            self._likelihoods.clear()
        self._neighbours = neighbours
        self._next = max(3 * self._frames, _SOON)
        if np.isfinite(ratio.value):
            expected = (share * (1.0 + (gain - 1.0) * _STEPS)) ** -FALL
            error = np.hypot(ratio.spread, _EXACT * expected)
            away = (ratio.value - expected) / error
            self._likelihoods.append(-0.5 * np.square(away) - np.log(error))

    @property
    def value(self) -> float:
        """A cautious estimate; 0 where noise has hidden all errors."""
        if not self._likelihoods:
            return 0.0
        usual = -0.5 * np.square((_STEPS - _USUAL) / _SPREAD)
        logarithms = usual + np.sum(self._likelihoods, axis=0)
        below = np.cumsum(np.exp(logarithms - logarithms.max()))
        return float(np.interp(_CAUTION, below / below[-1], _STEPS))
