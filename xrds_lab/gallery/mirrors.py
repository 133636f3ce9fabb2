"""Shots with mirrors: what is seen in them moves in its own way."""

from __future__ import annotations

from ..studio.geometry import box, sphere
from ..studio.nodes import solid
from . import bending
from .stage import COLD, CREAM, Set, checks, mirror, room, slide, truck, turn


def plane_mirror(stage: Set) -> None:
    """A mirror on the wall, under a moving camera."""
    room(stage)
    stage.put(box(3.4, 0.05, 2.3), mirror(), (-0.6, 3.8, 0.6))
    truck(stage)


def mirror_ball(stage: Set) -> None:
    """A chrome ball under a moving camera."""
    room(stage)
    stage.put(sphere(0.8, 64), mirror(), (0.1, -0.2, 0.8))
    truck(stage)


def moving_mirror(stage: Set) -> None:
    """A mirror that turns before a camera that stands still."""
    room(stage)
    pane = stage.put(box(2.4, 0.05, 2.0), mirror(), (-0.2, 1.4, 0.4))
    turn(pane, (0.0, 0.0, 0.008))


def facing_mirrors(stage: Set) -> None:
    """Two mirrors that face each other: a corridor of pictures of a box."""
    room(stage)
    stage.scene.cycles.glossy_bounces = stage.scene.cycles.max_bounces = 8
    stage.put(box(5.0, 0.05, 2.6), mirror(), (0.2, 2.6, 0.1), 0.06)
    stage.put(box(5.0, 0.05, 1.1), mirror(), (0.2, -2.2, 0.0))
    stuff = checks("between", CREAM, COLD, 8.0)
    stage.put(box(0.5, 0.5, 0.9), stuff, (-0.5, 0.4, 0.1), 0.5)
    truck(stage)


def figure_in_ball(stage: Set) -> None:
    """A figure that walks, in a chrome ball, before a camera that stands still."""
    room(stage)
    stage.put(sphere(0.9, 64), mirror(), (0.9, 0.6, 0.9))
    bending.walker(stage, (-0.9, -0.6, 0.0))


def figure_in_mirror(stage: Set) -> None:
    """A figure that walks, in a plane mirror, before a camera that stands still."""
    room(stage)
    stage.put(box(3.6, 0.05, 2.4), mirror(), (0.6, 2.6, 0.1), -0.15)
    bending.walker(stage, (-0.7, 0.6, 0.0))


def glossy_floor(stage: Set) -> None:
    """A floor that mirrors a box that moves, not quite sharply."""
    room(stage)
    stuff = solid("wax", Base_Color=(0.1, 0.07, 0.05), Roughness=0.12, Metallic=0.6)
    stage.put(box(6, 4, 0.01), stuff, (0, 0, 0))
    thing = stage.put(box(0.6, 0.6, 0.9), checks("moved", CREAM, COLD), (0, 0.2, 0.2))
    slide(thing, (0.04, 0.0, 0.0))
