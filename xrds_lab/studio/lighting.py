"""Sun, skies and lamps."""

from __future__ import annotations

import math

from . import patterns
from .assets import load_image
from .geometry import Point, box, cylinder, lathe, sphere
from .nodes import Colour
from .stage import Stage

WARM = ((1.0, 0.75, 0.5), (1.0, 0.85, 0.7), (1.0, 1.0, 1.0), (0.8, 0.9, 1.0))


def sky(stage: Stage, strength: float = 1.0) -> None:
    """A picture of a sky where there are assets, else a gradient with clouds."""
    if stage.library is not None and stage.chance(0.75):
        _picture_sky(stage, strength)
    else:
        _painted_sky(stage, strength)


def _picture_sky(stage: Stage, strength: float) -> None:
    nodes, rng = stage.world(), stage.rng
    path = rng.choice(stage.library.skies)
    stage.library.note(path)
    at = nodes.add(
        "Mapping",
        Vector=nodes.add("TexCoord").outputs["Generated"],
        Rotation=(0, 0, rng.uniform(0, 2 * math.pi)),
    )
    image = load_image(path, colour=False)
    image.colorspace_settings.name = "Linear Rec.709"
    picture = nodes.add("TexEnvironment", image=image, Vector=at.outputs[0])
    # Night skies are made bright enough to light a scene.
    nodes.light(picture.outputs["Color"], strength * (8 if "night" in path.name else 1))


def _painted_sky(stage: Stage, strength: float) -> None:
    nodes, rng = stage.world(), stage.rng
    way = nodes.add("TexCoord").outputs["Generated"]
    height = nodes.add("SeparateXYZ", Vector=way).outputs["Z"]
    zenith = (
        0.1 + 0.2 * rng.random(),
        0.25 + 0.2 * rng.random(),
        0.5 + 0.4 * rng.random(),
    )
    horizon = tuple(0.5 + 0.5 * rng.random() for _ in range(3))
    ground = patterns.colour(rng, 0.05, 0.3)
    stops = [(0.0, ground), (0.49, ground), (0.5, horizon), (0.85, zenith)]
    base = nodes.ramp(nodes.span(height, 0.5, 1.0), stops, "LINEAR")
    if stage.chance(0.6):
        noise = nodes.add("TexNoise", Vector=way, Scale=rng.uniform(2, 6), Detail=3.0)
        clouds = nodes.ramp(
            noise.outputs[0], [(0.5, (0,) * 3), (0.7, (1,) * 3)], "EASE"
        )
        base = nodes.mix(base, (0.9, 0.9, 0.9), clouds)
    nodes.light(base, strength)


def sun(stage: Stage, strength: float = 4.0) -> None:
    """A sun that shines downward from anywhere."""
    rng = stage.rng
    energy = strength * rng.uniform(0.5, 2.0)
    angle = math.radians(rng.choice((0.5, 0.5, 2.0, 8.0)))
    colour = rng.choice(WARM)
    turn = rng.uniform(0, 2 * math.pi)
    way = (math.cos(turn), math.sin(turn), -rng.uniform(0.3, 1.5))
    stage.lamp("SUN", energy, (0, 0, 0), way, "sun", angle=angle, color=colour)


def area(
    stage: Stage, at: Point, target: Point, size: float, watts: float, colour: Colour
) -> None:
    """A rectangular lamp at `at` shining at `target`."""
    size_y = size * stage.rng.uniform(0.3, 1.0)
    shape = {"shape": "RECTANGLE", "size": size, "size_y": size_y}
    stage.lamp("AREA", watts, at, target, "area", color=colour, **shape)


def point(stage: Stage, at: Point, watts: float, colour: Colour, radius: float) -> None:
    """A small round lamp."""
    below = (at[0], at[1], at[2] - 1)
    light = {"color": colour, "shadow_soft_size": radius}
    stage.lamp("POINT", watts, at, below, "point", **light)


def spot(stage: Stage, at: Point, target: Point, watts: float, colour: Colour) -> None:
    """A spot light."""
    cone = {"spot_size": stage.rng.uniform(0.4, 1.4), "shadow_soft_size": 0.05}
    stage.lamp("SPOT", watts, at, target, "spot", color=colour, **cone)


def softbox(stage: Stage, at: Point, target: Point, size: float, watts: float) -> None:
    """An area lamp with a visible frame, as studios have."""
    rng = stage.rng
    area(stage, at, target, size, watts, rng.choice(WARM))


def pendant(stage: Stage, at: Point, drop: float, watts: float) -> None:
    """A lamp with an open shade hanging `drop` metres below `at`."""
    rng, wide = stage.rng, stage.rng.uniform(0.1, 0.3)
    x, y, z = at[0], at[1], at[2] - drop
    tall = wide * rng.uniform(0.5, 1.5)
    profile = [(wide, 0), (wide * rng.uniform(0.6, 1), tall * 0.6), (0.03, tall)]
    stage.put(lathe(profile, 32), stage.paint.any(0.3), (x, y, z))
    stage.put(cylinder(0.004, drop - tall), stage.paint.painted(), (x, y, z + tall))
    _bulb(stage, (x, y, z + tall * 0.3), watts)


def floor_lamp(stage: Stage, at: Point, height: float, watts: float) -> None:
    """A lamp on a thin stand with a glowing shade."""
    rng, (x, y, z) = stage.rng, at
    metal = stage.paint.metal(0.3)
    stage.put(cylinder(height * 0.1, 0.02, 32), metal, at)
    stage.put(cylinder(0.01, height), metal, at)
    wide = height * rng.uniform(0.1, 0.18)
    shade = lathe([(wide, 0), (wide * rng.uniform(0.5, 1), wide * 1.4)], 40)
    stage.put(
        shade, stage.paint.glowing(0.5, rng.uniform(1, 6)), (x, y, z + height - wide)
    )
    _bulb(stage, (x, y, z + height), watts)


def _bulb(stage: Stage, at: Point, watts: float) -> None:
    colour = stage.rng.choice(WARM)
    glow = stage.paint.glowing(1.0, watts * 0.5)
    stage.put(sphere(0.03, 16), glow, (at[0], at[1], at[2]))
    point(stage, (at[0], at[1], at[2] - 0.06), watts, colour, 0.04)


def tube_light(stage: Stage, at: Point, length: float, turn: float) -> None:
    """A fluorescent tube under a ceiling."""
    stage.put(box(length, 0.08, 0.04), stage.paint.painted(), at, turn)
    glow = stage.paint.glowing(1.0, stage.rng.uniform(10, 40))
    stage.put(box(length * 0.95, 0.05, 0.03), glow, (at[0], at[1], at[2] - 0.03), turn)
