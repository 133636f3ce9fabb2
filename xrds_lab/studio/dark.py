"""Caves and cellars: rough walls, small coloured lights, at times thin smoke."""

from __future__ import annotations

import math

import numpy as np

from . import lighting, props
from .geometry import Shape, cone, cylinder, joined, lumpy, sheet, sphere, torus, tube
from .nodes import air
from .stage import Stage, turned


def build(stage: Stage) -> None:
    """A cave or a round tunnel with emitters and things on its floor."""
    rng = stage.rng
    rock = (
        stage.paint.pictured(2.0) if stage.chance(0.6) else stage.paint.patterned(2.0)
    )
    tunnel = stage.chance(0.4)
    stage.put(_tunnel(stage) if tunnel else _cave(stage), rock)
    floor = sheet(16, 16, 60, 60)
    floor = floor.bent(
        lambda v: (
            v + np.c_[0 * v[:, :2], 0.1 * np.sin(v[:, 0] * 3) * np.sin(v[:, 1] * 2.3)]
        )
    )
    stage.put(
        floor, rock if stage.chance(0.4) else stage.paint.floor(2.0), (0, 0, -0.1)
    )
    for _ in range(rng.randint(8, 30)):
        props.small_thing(stage, _spot(stage), rng.uniform(0.1, 0.9), 0.3)
    _crystals(stage)
    _pipes(stage)
    _lights(stage)
    if stage.chance(0.2):
        _smoke(stage)
    for _ in range(6):
        angle, away = turned(rng), rng.uniform(1.5, 3.0)
        eye = (away * math.cos(angle), away * math.sin(angle), rng.uniform(0.5, 1.8))
        target = (-eye[0] * 0.5, -eye[1] * 0.5, rng.uniform(0.2, 1.5))
        stage.look(eye, target, rng.choice((20, 28, 35, 50)))


def _spot(stage: Stage) -> tuple[float, float, float]:
    return (stage.rng.uniform(-3, 3), stage.rng.uniform(-3, 3), 0.0)


def _cave(stage: Stage) -> Shape:
    shape = lumpy(sphere(4.5, 128), stage.dice, stage.rng.uniform(1, 3), 0.4)
    return lumpy(shape, stage.dice, 0.4, 0.08)


def _tunnel(stage: Stage) -> Shape:
    path = [(0.3 * math.sin(y), y, 1.2) for y in np.linspace(-9, 9, 60)]
    return tube(path, stage.rng.uniform(3.3, 4.0), 64)


def _crystals(stage: Stage) -> None:
    material = stage.rng.choice(
        (stage.paint.glass, stage.paint.glowing, stage.paint.coated)
    )(0.3)
    spikes = []
    for _ in range(stage.rng.randint(0, 25)):
        size = stage.rng.uniform(0.1, 0.7)
        spike = cone(size * 0.15, 0.0, size, 6).rotated("x", stage.rng.gauss(0, 0.5))
        spikes.append(spike.moved(_spot(stage), turned(stage.rng)))
    if spikes:
        stage.put(joined(spikes), material)


def _pipes(stage: Stage) -> None:
    for _ in range(stage.rng.randint(0, 5)):
        a, b = _spot(stage), _spot(stage)
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, stage.rng.uniform(0.5, 2.5))
        t = np.linspace(0, 1, 24)[:, None]
        path = (1 - t) ** 2 * a + 2 * t * (1 - t) * np.array(middle) + t**2 * b
        stage.put(tube(path, stage.rng.uniform(0.01, 0.08)), stage.paint.any(0.5))


def _lights(stage: Stage) -> None:
    rng = stage.rng
    stage.even_world(props.tone(stage), rng.choice((0.0, 0.01, 0.05)))
    for _ in range(rng.randint(2, 7)):
        x, y, _z = _spot(stage)
        z, colour = rng.uniform(0.3, 2.5), props.tone(stage)
        kind = rng.random()
        if kind < 0.35:
            lighting.point(stage, (x, y, z), rng.uniform(10, 80), colour, 0.05)
        elif kind < 0.5:
            lighting.spot(
                stage, (x, y, z + 0.5), _spot(stage), rng.uniform(50, 400), colour
            )
        elif kind < 0.75:
            radius = rng.uniform(0.03, 0.15)
            stage.put(
                sphere(radius, 24), stage.paint.glowing(0.2, 0.5 / radius**2), (x, y, z)
            )
        else:
            shape = torus(0.3, 0.015) if stage.chance(0.5) else cylinder(0.015, 1.2, 8)
            stage.put(
                shape.rotated("x", rng.uniform(0, 3)),
                stage.paint.glowing(0.5, rng.uniform(20, 60)),
                (x, y, z),
            )


def _smoke(stage: Stage) -> None:
    """Thin even smoke all around."""
    smoke = air("smoke", stage.rng.uniform(0.02, 0.12))
    stage.put(sphere(8.0, 16), smoke)
