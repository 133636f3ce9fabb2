"""Hundreds of small random things with random materials."""

from __future__ import annotations

import math

from . import lighting, props
from .geometry import Shape, box, cone, cylinder, sheet, sphere, torus
from .stage import Stage, turned


def build(stage: Stage) -> None:
    """Heaps of primitives of a shared set of materials on a floor with back walls."""
    rng = stage.rng
    stage.put(sheet(14, 14), stage.paint.floor(1.0))
    if stage.chance(0.6):
        back = sheet(14, 6).rotated("x", math.pi / 2)
        stage.put(back, stage.paint.wall(1.0), (0, 3, 3))
    materials = [
        stage.paint.any(rng.choice((0.2, 0.5, 1.0))) for _ in range(rng.randint(8, 24))
    ]
    materials += [stage.paint.varied()]
    floating, reach = stage.chance(0.4), rng.uniform(1.0, 2.5)
    meshes = [_primitive(stage) for _ in range(12)]
    for _ in range(rng.randint(80, 350)):
        at = (
            rng.gauss(0, reach),
            rng.gauss(0, reach * 0.7),
            rng.uniform(0, 2) if floating else 0,
        )
        thing = stage.put(rng.choice(meshes), rng.choice(materials), at, turned(rng))
        thing.scale = (2 ** rng.uniform(-1.5, 1),) * 3
        if floating:
            thing.rotation_euler = [turned(rng) for _ in range(3)]
    for _ in range(rng.randint(2, 8)):
        at = (rng.gauss(0, reach), rng.gauss(0, reach), 0)
        props.small_thing(stage, at, rng.uniform(0.2, 1.0), 0.7)
    _light(stage)
    for _ in range(6):
        angle, away = rng.uniform(math.pi, 2 * math.pi), rng.uniform(1.5, 5.0)
        eye = (away * math.cos(angle), away * math.sin(angle), rng.uniform(0.4, 2.5))
        target = (rng.gauss(0, 0.5), rng.gauss(0, 0.5), rng.uniform(0.1, 1.0))
        stage.look(eye, target, rng.choice((24, 35, 50, 70)))


def _primitive(stage: Stage) -> Shape:
    rng, size = stage.rng, stage.rng.uniform(0.08, 0.4)
    kinds = (
        lambda: box(size, size * rng.random(), size * rng.random()),
        lambda: sphere(size / 2, 32),
        lambda: cylinder(size * rng.uniform(0.02, 0.4), size * 1.5, 24),
        lambda: cone(size * 0.4, 0.0, size, 24),
        lambda: torus(size * 0.4, size * rng.uniform(0.03, 0.12)),
        lambda: box(size * 2, size * 0.04, size * 0.04),
    )
    return rng.choice(kinds)()


def _light(stage: Stage) -> None:
    rng = stage.rng
    lighting.sky(stage, rng.uniform(0.1, 1.2))
    if stage.chance(0.4):
        lighting.sun(stage)
    for _ in range(rng.randint(0, 3)):
        at = (rng.uniform(-4, 4), rng.uniform(-5, 2), rng.uniform(1.5, 4))
        lighting.area(
            stage,
            at,
            (0, 0, 0),
            rng.uniform(0.1, 2),
            rng.uniform(50, 500),
            props.tone(stage),
        )
