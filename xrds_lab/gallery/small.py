"""Shots of what is as small as pixels: rails, letters, squares."""

from __future__ import annotations

from ..studio.geometry import box, joined, rod, sheet
from ..studio.nodes import solid
from .stage import COLD, CREAM, Set, checks, room, truck

_LINES = (
    "Nearest pixel, never interpolate.",
    "0123456789 ABCDEFGHIJKLM",
    "the quick brown fox jumps",
    "over the lazy dog; all of it",
    "NOPQRSTUVWXYZ .,:;!?",
    "samples of other frames",
)


def rails(stage: Set) -> None:
    """Rails and wires one or two pixels wide, under a moving camera."""
    room(stage)
    posts = [rod((0.07 * i, 0, 0), (0.07 * i, 0, 1.1), 0.007) for i in range(50)]
    wires = [rod((0, 0, 0.2 * i), (3.5, 0, 0.2 * i + 0.1), 0.004) for i in range(6)]
    steel = solid("steel", Base_Color=(0.75, 0.75, 0.78), Metallic=0.8, Roughness=0.3)
    stage.put(joined([*posts, *wires]), steel, (-1.7, -0.5, 0.1))
    truck(stage)


def text(stage: Set) -> None:
    """Letters five pixels high on a board."""
    room(stage)
    stage.put(box(1.9, 0.04, 1.3), solid("paper", Base_Color=CREAM), (0, -0.5, 0.6))
    ink = solid("ink", Base_Color=(0.02, 0.02, 0.03))
    for number, line in enumerate(_LINES * 2):
        height = 1.78 - 0.1 * number
        stage.write(line, 0.085, ink, (-0.85, -0.525, height), extrude=0.001)
    truck(stage)


def fine_checks(stage: Set) -> None:
    """Squares of one to five pixels on the floor, under a moving camera."""
    room(stage)
    fine = checks("fine", CREAM, COLD, 22.0)
    stage.put(sheet(6, 5), fine, (0, 0.4, 0.01))
    finer = checks("finer", CREAM, (0.1, 0.05, 0.05), 45.0)
    stage.put(box(1.6, 0.05, 1.2), finer, (0.1, -0.2, 0.3), 0.2)
    truck(stage)
