"""Exteriors: facades with sidings, windows, railings, plants, sun and sky."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import bpy
import numpy as np

from . import lighting, props
from .geometry import Point, Shape, box, cylinder, joined, quads, rod, sheet, wall
from .stage import Stage, turned

Hole = tuple[float, ...]  # x0, z0, x1, z1 in the plane of a wall


def build(stage: Stage) -> None:
    """One or two houses in a garden or street."""
    rng = stage.rng
    ground = sheet(80, 80)
    stage.put(
        ground,
        stage.paint.pictured(1.0) if stage.chance(0.7) else stage.paint.patterned(2.0),
    )
    x, y, floors = rng.uniform(6, 12), rng.uniform(5, 9), rng.randint(1, 3)
    house(stage, (0, 0, 0), x, y, floors)
    if stage.chance(0.6):
        beside = x / 2 + 3 + rng.uniform(0.5, 4)
        house(stage, (beside, rng.uniform(0, 3), 0), 6, 6, rng.randint(1, 3))
    _garden(stage, x, y)
    lighting.sky(stage, rng.uniform(0.4, 1.2))
    if stage.chance(0.7):
        lighting.sun(stage)
    _views(stage, x, y, floors * 3.0)


def house(
    stage: Stage, at: tuple[float, float, float], x: float, y: float, floors: int
) -> None:
    """A house with siding, windows, roof and porch; its front faces -y."""
    tall = floors * 2.9
    skin = stage.paint.wall(2.0)
    siding = stage.rng.choice(("boards", "boards", "battens", "flat"))
    # Each wall runs from its corner so that the face it shows looks outward.
    walls = [
        (-x / 2, -y / 2, 0.0, x),
        (x / 2, -y / 2, math.pi / 2, y),
        (x / 2, y / 2, math.pi, x),
        (-x / 2, y / 2, -math.pi / 2, y),
    ]
    frame, trim = stage.paint.painted(), stage.paint.painted()
    for cx, cy, turn, length in walls:
        spot = (at[0] + cx, at[1] + cy, at[2])
        holes = _openings(stage, length, floors)
        stage.put(wall(length, tall, holes), skin, spot, turn)
        stage.put(_siding(stage, siding, length, tall, holes), skin, spot, turn)
        _window_parts(stage, spot, turn, holes, frame, trim)
    _roof(stage, at, x, y, tall)
    if stage.chance(0.7):
        _porch(stage, at, x, y)


def _openings(stage: Stage, length: float, floors: int) -> list[Hole]:
    rng, count = stage.rng, max(1, int(length / stage.rng.uniform(1.6, 2.6)))
    wide, tall = min(rng.uniform(0.7, 1.2), length / count * 0.6), rng.uniform(1.1, 1.7)
    return [
        (
            length * (i + 0.5) / count - wide / 2,
            f * 2.9 + 0.8,
            length * (i + 0.5) / count + wide / 2,
            f * 2.9 + 0.8 + tall,
        )
        for f in range(floors)
        for i in range(count)
        if rng.random() < 0.85
    ]


def _siding(
    stage: Stage, kind: str, length: float, tall: float, holes: list[Hole]
) -> Shape:
    """Overlapping boards or upright battens, cut by the windows."""
    if kind == "flat":
        return box(length, 0.06, 0.3).shifted((length / 2, -0.03, 0))
    pitch = (
        stage.rng.uniform(0.09, 0.2)
        if kind == "boards"
        else stage.rng.uniform(0.2, 0.5)
    )
    strips = []
    for start in np.arange(0, tall if kind == "boards" else length, pitch):
        for a, b in _free(
            start, pitch, length if kind == "boards" else tall, holes, kind
        ):
            strips.append(_strip(kind, start, pitch, a, b))
    return quads(np.array(strips))


def _strip(kind: str, start: float, pitch: float, a: float, b: float) -> list[Hole]:
    if kind == "boards":  # leaning out at the foot
        z0, z1 = start, start + pitch * 1.05
        return [(a, -0.03, z0), (b, -0.03, z0), (b, -0.004, z1), (a, -0.004, z1)]
    return [
        (start, -0.03, a),
        (start + 0.05, -0.03, a),
        (start + 0.05, -0.03, b),
        (start, -0.03, b),
    ]


def _free(
    start: float, pitch: float, end: float, holes: list[Hole], kind: str
) -> list[tuple[float, float]]:
    """The stretches of a strip that no hole interrupts."""
    i, j = (1, 0) if kind == "boards" else (0, 1)
    cuts = sorted(
        (h[j], h[j + 2]) for h in holes if h[i] < start + pitch and h[i + 2] > start
    )
    spans, at = [], 0.0
    for low, high in cuts:
        if low > at:
            spans.append((at, low))
        at = max(at, high)
    return [*spans, (at, end)] if at < end else spans


def _window_parts(
    stage: Stage,
    spot: Point,
    turn: float,
    holes: Sequence[Hole],
    frame: bpy.types.Material,
    trim: bpy.types.Material,
) -> None:
    """Panes, bars and trims of all windows of one wall."""
    if not holes:
        return
    panes, bars, boards = [], [], []
    columns, rows = stage.rng.randint(1, 3), stage.rng.randint(1, 4)
    for x0, z0, x1, z1 in holes:
        w, h, mid = x1 - x0, z1 - z0, (x0 + x1) / 2
        panes.append(box(w, 0.01, h).shifted((mid, 0.08, z0)))
        bars += [
            box(0.03, 0.05, h).shifted((x0 + w * i / columns, 0.06, z0))
            for i in range(columns + 1)
        ]
        bars += [
            box(w, 0.05, 0.03).shifted((mid, 0.06, z0 + h * k / rows - 0.015))
            for k in range(rows + 1)
        ]
        boards += [
            box(0.1, 0.06, h + 0.1).shifted((x, -0.03, z0 - 0.05))
            for x in (x0 - 0.05, x1 + 0.05)
        ]
        boards += [
            box(w + 0.3, 0.1, 0.08).shifted((mid, -0.05, z)) for z in (z0 - 0.08, z1)
        ]
    glass = stage.paint.coated(1.0) if stage.chance(0.5) else stage.paint.mirror()
    stage.put(joined(panes), glass, spot, turn)
    stage.put(joined(bars), frame, spot, turn)
    stage.put(joined(boards), trim, spot, turn)


def _roof(
    stage: Stage, at: tuple[float, float, float], x: float, y: float, tall: float
) -> None:
    """A gable roof with shingles or tiles, gutters and a chimney."""
    rng, over = stage.rng, 0.4
    rise = y / 2 * rng.uniform(0.5, 1.2)
    slope = math.atan2(rise, y / 2)
    long = math.hypot(rise, y / 2) + over
    material = (
        stage.paint.tiles(1.0) if stage.chance(0.5) else stage.paint.pictured(1.0)
    )
    rows = int(long / rng.uniform(0.15, 0.35))
    slats = [
        box(x + 2 * over, long / rows * 1.1, 0.02)
        .rotated("x", -0.06)
        .shifted((0, (i + 0.5) * long / rows - long, 0))
        for i in range(rows)
    ]
    for turn in (0.0, math.pi):
        side = (
            joined(slats).rotated("x", slope).shifted((0, 0, rise)).rotated("z", turn)
        )
        stage.put(side, material, (at[0], at[1], at[2] + tall))
    gable = np.array(
        [
            [
                (s * x / 2, -y / 2, 0),
                (s * x / 2, y / 2, 0),
                (s * x / 2, 0, rise),
                (s * x / 2, 0, rise),
            ]
            for s in (-1, 1)
        ]
    )
    stage.put(quads(gable), stage.paint.wall(2.0), (at[0], at[1], at[2] + tall))
    stage.put(
        box(0.6, 0.6, 1.5),
        stage.paint.tiles(1.0),
        (at[0] + x / 4, at[1], at[2] + tall + rise * 0.6),
    )


def _porch(stage: Stage, at: tuple[float, float, float], x: float, y: float) -> None:
    """Posts, railings and a floor in front of the house."""
    rng, deep = stage.rng, 1.6
    front = at[1] - y / 2 - deep
    wood = stage.paint.painted()
    stage.put(box(x, deep, 0.3), stage.paint.boards(), (at[0], front + deep / 2, at[2]))
    stage.put(box(x, deep + 0.3, 0.15), wood, (at[0], front + deep / 2, at[2] + 2.6))
    count = rng.randint(3, 7)
    spots = [at[0] - x / 2 + 0.1 + (x - 0.2) * i / count for i in range(count + 1)]
    posts = [cylinder(0.07, 2.4, 12).shifted((s, front, at[2] + 0.3)) for s in spots]
    stage.put(joined(posts), wood)
    for a, b in pairwise(spots):
        if rng.random() < 0.8:
            props.railing(stage, (a, front, at[2] + 0.3), (b, front, at[2] + 0.3), 0.9)


def _garden(stage: Stage, x: float, y: float) -> None:
    rng = stage.rng
    for _ in range(rng.randint(2, 6)):
        at = (rng.uniform(-x, x), -y / 2 - rng.uniform(2.2, 6), 0)
        props.plant(stage, at, rng.uniform(0.5, 3.0))
    if stage.chance(0.6):
        props.grass(stage, (rng.uniform(-3, 3), -y / 2 - 3.5, 0), 2.5, 6000)
    for _ in range(rng.randint(1, 5)):
        at = (rng.uniform(-x, x), -y / 2 - rng.uniform(2, 7), 0)
        props.small_thing(stage, at, rng.uniform(0.3, 2.0), 0.8)
    if stage.chance(0.6):
        props.railing(stage, (-x, -y / 2 - 5, 0), (x, -y / 2 - 5, 0), 1.0)
    if stage.chance(0.5):
        wires = [
            rod((-20, -y / 2 - 2 + i * 0.3, 6), (20, -y / 2 - 1 + i * 0.3, 6.5), 0.012)
            for i in range(4)
        ]
        stage.put(joined(wires), stage.paint.painted())
    for _ in range(rng.randint(0, 3)):
        stage.model(
            rng.uniform(3, 7),
            (rng.uniform(-15, 15), rng.uniform(2, 12), 0),
            turned(rng),
            ("tree", "house", "mill", "village", "tower", "truck", "van", "ferris"),
        )


def _views(stage: Stage, x: float, y: float, tall: float) -> None:
    rng = stage.rng
    for _ in range(6):
        away = rng.uniform(2.5, 11)
        eye = (rng.uniform(-x, x), -y / 2 - away, rng.uniform(0.8, 2.2))
        target = (rng.uniform(-x / 2, x / 2), -y / 2, rng.uniform(0.5, max(1.0, tall)))
        stage.look(eye, target, rng.choice((24, 28, 35, 50)), 0.15)
