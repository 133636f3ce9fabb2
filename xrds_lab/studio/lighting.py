"""Sun, skies and lamps."""

from __future__ import annotations

import math

import bpy

from . import patterns
from .assets import load_image
from .geometry import Point, box, cylinder, lathe, sphere
from .nodes import Colour, Nodes
from .stage import Stage, aim

WARM = ((1.0, 0.75, 0.5), (1.0, 0.85, 0.7), (1.0, 1.0, 1.0), (0.8, 0.9, 1.0))


def _world(stage: Stage) -> Nodes:
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    stage.scene.world = world
    return Nodes(world.node_tree)


def _background(nodes: Nodes, colour: object, strength: float) -> None:
    node = nodes.tree.nodes["Background"]
    nodes.plug(node.inputs["Color"], colour)
    node.inputs["Strength"].default_value = strength


def plain_world(stage: Stage, colour: Colour, strength: float) -> None:
    """The same light from everywhere."""
    _background(_world(stage), colour, strength)


def sky(stage: Stage, strength: float = 1.0) -> None:
    """A picture of a sky where there are assets, else a gradient with clouds."""
    if stage.library is not None and stage.chance(0.75):
        _picture_sky(stage, strength)
    else:
        _painted_sky(stage, strength)


def _picture_sky(stage: Stage, strength: float) -> None:
    nodes, rng = _world(stage), stage.rng
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
    _background(
        nodes, picture.outputs["Color"], strength * (8 if "night" in path.name else 1)
    )


def _painted_sky(stage: Stage, strength: float) -> None:
    nodes, rng = _world(stage), stage.rng
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
    _background(nodes, base, strength)


def sun(stage: Stage, toward: Point | None = None, strength: float = 4.0) -> None:
    """A sun; ``toward`` is the way its light goes, any downward one if None."""
    rng = stage.rng
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy = strength * rng.uniform(0.5, 2.0)
    lamp.angle = math.radians(rng.choice((0.5, 0.5, 2.0, 8.0)))
    lamp.color = rng.choice(WARM)
    turn = rng.uniform(0, 2 * math.pi)
    way = toward or (math.cos(turn), math.sin(turn), -rng.uniform(0.3, 1.5))
    _hung(stage, lamp, (0, 0, 0), way)


def area(
    stage: Stage, at: Point, target: Point, size: float, watts: float, colour: Colour
) -> None:
    """A rectangular lamp at ``at`` shining at ``target``."""
    lamp = bpy.data.lights.new("area", "AREA")
    lamp.shape, lamp.size = "RECTANGLE", size
    lamp.size_y = size * stage.rng.uniform(0.3, 1.0)
    lamp.energy, lamp.color = watts, colour
    _hung(stage, lamp, at, target)


def point(stage: Stage, at: Point, watts: float, colour: Colour, radius: float) -> None:
    """A small round lamp."""
    lamp = bpy.data.lights.new("point", "POINT")
    lamp.energy, lamp.color, lamp.shadow_soft_size = watts, colour, radius
    _hung(stage, lamp, at, (at[0], at[1], at[2] - 1))


def spot(stage: Stage, at: Point, target: Point, watts: float, colour: Colour) -> None:
    """A spot light."""
    lamp = bpy.data.lights.new("spot", "SPOT")
    lamp.energy, lamp.color = watts, colour
    lamp.spot_size = stage.rng.uniform(0.4, 1.4)
    lamp.shadow_soft_size = 0.05
    _hung(stage, lamp, at, target)


def _hung(stage: Stage, lamp: bpy.types.Light, at: Point, target: Point) -> None:
    thing = bpy.data.objects.new(lamp.name, lamp)
    stage.scene.collection.objects.link(thing)
    aim(thing, at, target)


def softbox(stage: Stage, at: Point, target: Point, size: float, watts: float) -> None:
    """An area lamp with a visible frame, as studios have."""
    rng = stage.rng
    area(stage, at, target, size, watts, rng.choice(WARM))


def pendant(stage: Stage, at: Point, drop: float, watts: float) -> None:
    """A lamp with an open shade hanging ``drop`` metres below ``at``."""
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
