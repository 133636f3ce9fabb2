"""Accumulates the frames of a shot, on a graphics card where there is one."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from ..temporal.accumulate import PROCESSOR, accumulate
from ..temporal.vectors import Movement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..gpu.accumulate import CardAccumulator
    from ..temporal.accumulate import Accumulated
    from ..temporal.frame import Stored


class Accumulator:
    """Accumulates the frames of one shot; what it finds of their motion is kept.

    `device` is `auto` (a graphics card that is fit for it, else the processor), `cpu`,
    `gpu`, or a part of a card's name. Nothing of a card is loaded before `prepare`, or
    before two frames are accumulated.
    """

    def __init__(self, device: str = "auto") -> None:
        self._asked, self._movement = device, Movement()
        self.device = PROCESSOR
        """What accumulated last: a card's name, or `cpu`."""

    def prepare(self) -> None:
        """Open the card, which takes seconds, before anything is timed; raises as
        `__call__`.
        """
        open_card(self._asked)

    def __call__(self, target: Stored, others: Sequence[Stored] = ()) -> Accumulated:
        """`accumulate`; raises UsageError for a card asked for that is not here."""
        if not others:
            return accumulate(target, others)
        card = open_card(self._asked)
        found = accumulate(target, others, self._movement, card=card)
        self.device = found.device
        return found


def device_of(card: CardAccumulator | None) -> str:
    """Return the name of what accumulates."""
    return PROCESSOR if card is None or card.is_lost else card.card.name


@cache
def open_card(device: str) -> CardAccumulator | None:
    """Return the card of a name, as `Accumulator`; opened once in a process.

    None where the processor accumulates.
    """
    if device == PROCESSOR:
        return None
    from ..gpu.choose import choose

    return choose(device)
