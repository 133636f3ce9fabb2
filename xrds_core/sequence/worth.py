"""What a sample of a neighbour is worth beside one of a frame's own, in a shot.

It is measured in the first frame, again in the first one with neighbours on both sides,
and then each time that the shot is twice as far: so chance counts less and less, and
the seconds of measuring are soon a small part of the shot's.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

_TINY = 1e-6
_SOON = 8  # frames; by then one has neighbours on both sides


class Ratio(NamedTuple):
    """The squared error of fewer samples with neighbours over that of all without.

    `spread` is its standard error. Errors fall with the power `fall` of the samples.
    """

    value: float
    spread: float
    fall: float


@dataclass
class Worth:
    """The worth, from 0 to 1, of the samples of neighbours in one shot."""

    _found: list[tuple[float, float]] = field(default_factory=list)
    _neighbours: int = 0
    _frames: int = 0
    _next: int = 1

    def is_due(self, neighbours: int) -> bool:
        """Count a frame; return whether it is to be measured in."""
        self._frames += 1
        more = neighbours >= 2 * max(self._neighbours, 1)
        return self._frames >= self._next or more

    def add(self, ratio: Ratio, share: float, gain: float, neighbours: int) -> None:
        """Take in what was measured in a frame that has a `share` of all samples.

        With its `neighbours` it has `gain` times its own. Fewer of them lie on one side
        only, and are worth less: they no longer count.
        """
        if neighbours > self._neighbours:
            self._found.clear()
        self._neighbours = neighbours
        self._next = max(2 * self._frames, _SOON)
        added = max(share * (gain - 1.0), 1e-9)

        def worth(value: float) -> float:
            # the share of all samples that is as good without neighbours
            alone = max(value, _TINY) ** (-1.0 / ratio.fall)
            return (alone - share) / added

        least = worth(ratio.value + ratio.spread)
        # far off is as bad as useless or perfect: one measurement is not to decide
        likely = float(np.clip(worth(ratio.value), least, least + 1.0))
        self._found.append((likely, likely - least))

    @property
    def value(self) -> float:
        """The mean of what was found, less its standard error."""
        likely, spread = np.array(self._found).T
        error = np.sqrt(np.square(spread).sum()) / len(spread)
        return float(np.clip(likely.mean() - error, 0.0, 1.0))
