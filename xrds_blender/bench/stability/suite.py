"""Every check on arrays over every shipped preset, scale and precision."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import hues, lies, light, sameness, shapes, spoilt
from .bounds import judge

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .bounds import Check
    from .measured import Measured
    from .subject import Subject

GROUPS = {
    "light": light.CHECKS,
    "spoilt": spoilt.CHECKS,
    "hues": hues.CHECKS,
    "lies": lies.CHECKS,
    "shapes": shapes.CHECKS,
    "sameness": sameness.CHECKS,
}


def checks(
    subject: Subject, work: Callable[[Subject], Iterator[Measured]]
) -> Iterator[tuple[Check, Measured]]:
    """Yield every value of one check with its verdict."""
    for measured in work(subject):
        verdict = judge(
            measured.name,
            measured.value,
            subject.preset,
            subject.scale,
            subject.precision,
        )
        yield verdict, measured
