"""The value of a neighbour: of its samples beside a frame's own, in a shot.

It is measured in the first frame, again in the first one beyond its neighbours, and
from there on as often as a small part of the shot's samples allows: other content has
another value, and so have other places of a picture. The last few measurements count
together. Where a small picture shows more chance than anything else, what other shots
have shown counts.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ..arrays import Array

# Frames from one measurement to the next: so many, or as many as let it take this share
# of their samples.
_SOON, _MOST = 12, 0.03
_LAST = 4  # measurements that count, each of them at another place
# What is known before anything is measured: mean and standard deviation over the
# choosing half of the gallery, 4 samples with neighbours against 16 without.
_USUAL, _SPREAD = 0.45, 0.25
# No ratio is better known than this, relative to it: errors do not fall quite with
# `FALL`, nor does every measure of them see the same.
_EXACT = 0.06
_CAUTION = 0.16  # probability of a lower value: the mean less its standard error
FALL = 0.7
"""The error of a denoised picture falls with about this power of its samples.

It is half where a denoiser guesses well, and 1 where texture leaves it little to do.
"""
_FALL_SPREAD = 0.2  # its standard deviation, from scene to scene and file to file
_FALLS = np.linspace(0.2, 1.3, 111)
_STEPS = np.linspace(0.0, 1.0, 201)
_TINY = 1e-30


def frames_between(price: float) -> int:
    """Frames from one measurement to the next, if each takes `price` times a frame's.

    The samples of all the file's settings are meant.
    """
    return max(_SOON, math.ceil(price / _MOST))


def measurements(frames: int, neighbours: int, price: float) -> int:
    """In how many frames of a shot it is measured where nothing changes.

    Half of a frame's `neighbours` lie before it. For `price` see `frames_between`.
    """
    both_sides = neighbours // 2 + 2  # the first such frame beyond the first one's
    return 1 + math.ceil(max(frames + 1 - both_sides, 0) / frames_between(price))


class Errors(NamedTuple):
    """Squared errors, by blocks; single ones may be negative, where noise hides them.

    Attributes
    ----------
    fewer : (n,) array
        Of fewer samples with neighbours.
    all : (n,) array
        Of all samples without.
    alone : (n,) array
        Of fewer samples without.
    """

    fewer: Array
    all: Array
    alone: Array

    @property
    def ratio(self) -> float:
        """Error of fewer samples over that of all; infinite where noise hides it."""
        whole = float(self.all.sum())
        return max(float(self.fewer.sum()), 0.0) / whole if whole > 0.0 else np.inf

    def misfit(self, ratio: Array) -> Array:
        """By how many standard errors each of some ratios of fewer to all is off."""
        return _misfit(self.fewer, self.all, ratio)

    def misfit_alone(self, ratio: Array) -> Array:
        """The same of fewer samples without neighbours."""
        return _misfit(self.alone, self.all, ratio)


def _misfit(one: Array, other: Array, ratio: Array) -> Array:
    """Return by how many standard errors each of some ratios of two errors is off.

    Neither need be known for that: blocks that are hard to render are so both ways, and
    what is left says how much is chance.
    """
    one, other = one.astype(np.float64), other.astype(np.float64)
    left = one - ratio[:, None] * other
    chance = left.std(axis=1) * np.sqrt(len(other))
    inexact = _EXACT * ratio * max(float(other.sum()), 0.0)
    return np.asarray(left.sum(axis=1) / np.maximum(np.hypot(chance, inexact), _TINY))


def _likely(misfits: Array) -> Array:
    """How likely values are, whose misfits have these sums of squares."""
    return np.asarray(np.exp(-0.5 * (misfits - misfits.min())))


class _Measurement(NamedTuple):
    errors: Errors
    share: float
    gain: float


@dataclass
class Worth:
    """The value, from 0 to 1, of the samples of neighbours in one shot.

    Attributes
    ----------
    fall : float
        The power of samples with which errors fall; `FALL` where noise hides it.
    value : float
        A cautious estimate; that of other shots where noise hides all errors.
    """

    fall: float = field(default=FALL, init=False)
    value: float = field(default=0.0, init=False)
    _falls: Array = field(default_factory=lambda: np.zeros_like(_FALLS))
    _measurements: deque[_Measurement] = field(
        default_factory=partial(deque, maxlen=_LAST)
    )
    _neighbours: int = 0
    _frames: int = 0
    _next: int = 1

    def __post_init__(self) -> None:
        self._estimate()

    def is_due(self, neighbours: int) -> bool:
        """Count a frame; return whether it is to be measured in."""
        self._frames += 1
        more = neighbours >= 2 * max(self._neighbours, 1)
        return self._frames >= self._next or more

    @property
    def is_old(self) -> bool:
        """Whether enough frames were counted to measure anew where a shot changes."""
        return self._frames >= _SOON

    def add(
        self,
        errors: Errors,
        share: float,
        gain: float,
        neighbours: int,
        price: float = 0.0,
    ) -> None:
        """Add the measurement of a frame.

        Where a frame has few neighbours these lie on one side only and are less
        valuable: what earlier measurements with fewer neighbours say of them is
        dropped.

        Parameters
        ----------
        errors : Errors
            Of the frame with its neighbours and by itself, and of one of all samples.
        share : float
            Share of all samples that the frame has.
        gain : float
            How many times its own samples the frame has with its neighbours.
        neighbours : int
            How many neighbours it has.
        price : float
            What measuring takes, as in `frames_between`.
        """
        if neighbours > self._neighbours:
            self._measurements.clear()
        self._neighbours = neighbours
        self._next = self._frames + frames_between(price)
        self._falls += np.square(errors.misfit_alone(share**-_FALLS))
        self._measurements.append(_Measurement(errors, share, gain))
        self._estimate()

    def _estimate(self) -> None:
        usual = np.square((_FALLS - FALL) / _FALL_SPREAD)
        self.fall = float(np.average(_FALLS, weights=_likely(usual + self._falls)))
        misfits = np.square((_STEPS - _USUAL) / _SPREAD)
        for errors, share, gain in self._measurements:
            equal = share * (1.0 + (gain - 1.0) * _STEPS)
            misfits += np.square(errors.misfit(equal**-self.fall))
        below = np.cumsum(_likely(misfits))
        self.value = float(np.interp(_CAUTION, below / below[-1], _STEPS))
