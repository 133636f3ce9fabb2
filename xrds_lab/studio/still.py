"""Product shots: a few glossy, metal and glass things on a studio sweep."""

from __future__ import annotations

import math

import numpy as np

from . import lighting, props
from .geometry import (
    Shape,
    Vertices,
    box,
    cylinder,
    joined,
    lathe,
    sheet,
    sphere,
    torus,
)
from .stage import Stage, turned


def build(stage: Stage) -> None:
    """Things on a sweep or a table under soft boxes, a sky, or both."""
    _ground(stage)
    hero = stage.rng.random()
    if hero < 0.4:
        vehicle(stage, (0, 0, 0), turned(stage.rng))
    elif hero < 0.65 and stage.library is not None:
        stage.model(
            stage.rng.uniform(1, 2),
            (0, 0, 0),
            turned(stage.rng),
            (
                "Car",
                "Wicker",
                "Shoe",
                "Glass",
                "Abalone",
                "Bottle",
                "tea",
                "Suzanne",
                "van",
                "bike",
                "headphones",
                "helicopter",
                "Lamp",
                "ship",
                "Chair",
                "truck",
            ),
        )
    for _ in range(stage.rng.randint(8, 26)):
        angle, away = turned(stage.rng), stage.rng.uniform(0.2, 1.6)
        at = (away * math.cos(angle), away * math.sin(angle), 0.0)
        props.small_thing(stage, at, stage.rng.uniform(0.15, 0.8), 0.35)
    _light(stage)
    for _ in range(6):
        angle, away = turned(stage.rng), stage.rng.uniform(1.2, 3.5)
        eye = (
            away * math.cos(angle),
            away * math.sin(angle),
            stage.rng.uniform(0.3, 2.5),
        )
        target = (stage.rng.uniform(-0.4, 0.4), stage.rng.uniform(-0.4, 0.4), 0.35)
        stage.look(eye, target, stage.rng.choice((28, 35, 50, 70)), 0.3)


def _ground(stage: Stage) -> None:
    rng = stage.rng
    makers = (
        stage.paint.painted,
        stage.paint.floor,
        stage.paint.coated,
        stage.paint.wood,
        stage.paint.patterned,
    )
    material = rng.choice(makers)(2.0)
    stage.put(sheet(30, 30), material)
    if stage.chance(0.5):
        radius = rng.uniform(5, 9)
        bend = [
            (radius * math.sin(a), radius * 0.4 * (1 - math.cos(a)))
            for a in np.linspace(0, 1.5, 16)
        ]
        stage.put(lathe([*bend, (bend[-1][0], 8)], 64), material)


def _light(stage: Stage) -> None:
    rng = stage.rng
    if stage.chance(0.65):
        lighting.sky(stage, rng.uniform(0.3, 1.5))
    else:
        stage.even_world(props.tone(stage), rng.uniform(0.02, 0.5))
    for _ in range(rng.randint(1, 4)):
        angle = turned(rng)
        at = (4 * math.cos(angle), 4 * math.sin(angle), rng.uniform(1.5, 5))
        lighting.softbox(
            stage, at, (0, 0, 0.3), rng.uniform(0.3, 3), rng.uniform(100, 600)
        )
    if stage.chance(0.3):
        stage.put(
            box(3, 0.05, 0.3),
            stage.paint.glowing(1.0, rng.uniform(3, 15)),
            (rng.uniform(-3, 3), 4, 2),
            turned(rng),
        )


def vehicle(stage: Stage, at: tuple[float, float, float], turn: float) -> None:
    """A rounded car-like body of lacquer and glass on four wheels, 2 m long."""
    rng, long = stage.rng, 2.0
    paint = stage.paint.coated(1.0)
    stage.put(_body(stage, long, 0.85, 0.42).shifted((0, 0, 0.38)), paint, at, turn)
    cabin = _body(stage, long * 0.55, 0.7, 0.42).shifted(
        (rng.uniform(-0.2, 0.2), 0, 0.62)
    )
    glass = stage.paint.glass(1.0) if stage.chance(0.5) else stage.paint.coated(1.0)
    stage.put(cabin, glass, at, turn)
    tyres, rims = [], []
    for x in (-0.62, 0.62):
        for y in (-0.4, 0.4):
            tyres.append(
                torus(0.15, 0.06).rotated("x", math.pi / 2).shifted((x, y, 0.21))
            )
            rims += [spoke.shifted((x, y, 0.21)) for spoke in _rim(stage)]
    stage.put(joined(tyres), stage.paint.painted(), at, turn)
    stage.put(joined(rims), stage.paint.metal(0.2), at, turn)
    _trim(stage, at, turn)


def _rim(stage: Stage) -> list[Shape]:
    count = stage.rng.choice((5, 6, 10))
    hub = cylinder(0.04, 0.06, 20).rotated("x", math.pi / 2).shifted((0, 0.03, 0))
    spokes = [
        box(0.016, 0.03, 0.13).rotated("y", 2 * math.pi * i / count)
        for i in range(count)
    ]
    return [hub, *spokes]


def _trim(stage: Stage, at: tuple[float, float, float], turn: float) -> None:
    """Lamps, grille and a stripe."""
    lamps = [sphere(0.07, 24).shifted((0.9, y, 0.42)) for y in (-0.28, 0.28)]
    stage.put(joined(lamps), stage.paint.glass(0.2), at, turn)
    bars = [box(0.03, 0.4, 0.008).shifted((0.97, 0, 0.28 + 0.02 * i)) for i in range(8)]
    bars += [
        box(1.2, 0.87, 0.012).shifted((0, 0, 0.4)),
        box(0.3, 0.9, 0.01).shifted((0, 0, 0.5)),
    ]
    stage.put(joined(bars), stage.paint.metal(0.2), at, turn)


def _body(stage: Stage, x: float, y: float, z: float) -> Shape:
    """A superellipsoid with random roundness."""
    power = stage.rng.uniform(0.35, 0.8)

    def squared(vertices: Vertices) -> Vertices:
        return np.sign(vertices) * np.abs(vertices) ** power * (x / 2, y / 2, z / 2)

    return sphere(1.0, 96).bent(squared)
