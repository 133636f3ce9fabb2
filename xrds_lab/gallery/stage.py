"""What the gallery's shots share: a textured room, a lamp and a camera that moves.

Shots hold still at frame 5, the middle of their nine frames; things move by a few
pixels a frame. Lengths are metres: 4 m away a metre is about 95 pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..studio.builder import Builder, aim, empty_scene
from ..studio.geometry import Point, box, sheet, sphere
from ..studio.nodes import Colour, Surface, Value, solid

SIZE = (480, 272)
MIDDLE = 5
KEYED = range(-9, 20)  # reaches beyond the frames, for blur and for steps of two
EYE, TARGET, LENS = (0.2, -3.8, 1.6), (0.0, 1.0, 1.0), 28.0
SHUTTER = 0.5  # frames
WARM, COLD, LEAF, CREAM = (
    (0.7, 0.28, 0.16),
    (0.12, 0.22, 0.45),
    (0.16, 0.4, 0.12),
    (0.8, 0.74, 0.6),
)


@dataclass
class Set(Builder):
    """A shot under construction; `folder` is for pictures that it makes."""

    folder: Path


def open_set(folder: Path, size: tuple[int, int] = SIZE) -> Set:
    """Open an empty file, set up for cheap pictures."""
    scene = empty_scene(*size)
    cycles = scene.cycles
    cycles.max_bounces = cycles.transmission_bounces = 6
    cycles.diffuse_bounces, cycles.glossy_bounces = 1, 4
    cycles.transparent_max_bounces = 8
    cycles.use_light_tree = False  # one or two lamps: it only takes time
    scene.frame_start, scene.frame_end = 1, 9
    return Set(scene, folder)


def over(value: Callable[[int], Any]) -> dict[int, Any]:
    """Values by frame; `value` takes frames from the middle one on."""
    return {frame: value(frame - MIDDLE) for frame in KEYED}


def key(owner: Any, path: str, values: Mapping[int, Any], hold: bool = False) -> None:
    """Keyframe an attribute by frame, straight from key to key, or with steps."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    for curve in curves_of(owner):
        for point in curve.keyframe_points:
            point.interpolation = "CONSTANT" if hold else "LINEAR"


def curves_of(owner: Any) -> list[Any]:
    """The animation curves of a data block or of one that lies in it."""
    data = owner.id_data.animation_data
    if not hasattr(data.action, "layers") or not data.action.layers:
        return list(data.action.fcurves)
    strips = [strip for layer in data.action.layers for strip in layer.strips]
    bag = strips[0].channelbag(data.action_slot)
    return list(bag.fcurves)


def slide(thing: Any, step: Point) -> None:
    """Move a thing by `step` a frame, through where it is now."""
    at = tuple(thing.location)
    moved = over(lambda k: tuple(x + k * by for x, by in zip(at, step, strict=True)))
    key(thing, "location", moved)


def turn(thing: Any, step: Point) -> None:
    """Turn a thing by `step` radians a frame about its axes."""
    now = tuple(thing.rotation_euler)
    turned = over(lambda k: tuple(x + k * by for x, by in zip(now, step, strict=True)))
    key(thing, "rotation_euler", turned)


def bake(stage: Set, cache: Any, start: int) -> None:
    """Run a simulation from a frame on and keep it: frames come in any order."""
    cache.frame_start, cache.frame_end = start, KEYED[-1]
    stage.scene.frame_set(start)
    bpy.ops.ptcache.bake_all(bake=True)


def truck(stage: Set, step: float = 0.04) -> None:
    """Move the camera sideways, about three pixels a frame."""
    slide(stage.scene.camera, (step, 0.0, 0.0))


# --- materials ------------------------------------------------------------------------


def uv(surface: Surface, density: float = 1.0) -> Value:
    """Texture coordinates, metres times `density`."""
    place = surface.add("TexCoord").outputs["UV"]
    return surface.add("Mapping", Vector=place, Scale=(density,) * 3).outputs[0]


def bricks(
    name: str, one: Colour, two: Colour, density: float = 2.0, **more: Any
) -> bpy.types.Material:
    """Matt bricks of two colours, half a metre long over `density`."""
    surface = Surface(name, Roughness=1.0, Specular_IOR_Level=0.0, **more)
    colours = surface.add(
        "TexBrick",
        Vector=uv(surface, density),
        Scale=1.0,
        Color1=one,
        Color2=two,
        Mortar=(0.08, 0.08, 0.08),
    )
    surface.set(Base_Color=colours.outputs["Color"])
    return surface.material


def checks(
    name: str, one: Colour, two: Colour, density: float = 8.0, **more: Any
) -> bpy.types.Material:
    """Squares of two colours, `density` in a metre."""
    surface = Surface(name, Roughness=0.5, **more)
    lifted = surface.add("VectorMath", Vector=uv(surface, density))
    lifted.inputs[1].default_value = (0.31, 0.37, 0.5)  # no edge at exactly 0
    squares = surface.add(
        "TexChecker", Vector=lifted.outputs[0], Scale=1.0, Color1=one, Color2=two
    )
    surface.set(Base_Color=squares.outputs["Color"])
    return surface.material


def marble(
    name: str, one: Colour, two: Colour, density: float = 5.0
) -> bpy.types.Material:
    """Soft spots of two colours."""
    surface = Surface(name, Roughness=0.5)
    noise = surface.add("TexNoise", Vector=uv(surface, density), Scale=1.0, Detail=3.0)
    colour = surface.ramp(noise.outputs[0], [(0.4, one), (0.6, two)], "LINEAR")
    surface.set(Base_Color=colour)
    return surface.material


def mirror(name: str = "mirror", roughness: float = 0.0) -> bpy.types.Material:
    """Silver."""
    return solid(name, Base_Color=(0.95, 0.95, 0.95), Metallic=1.0, Roughness=roughness)


def glass(name: str = "glass", ior: float = 1.45) -> bpy.types.Material:
    """Clear glass."""
    return solid(
        name, Base_Color=(1, 1, 1), Transmission_Weight=1.0, Roughness=0.0, IOR=ior
    )


def glow(name: str, colour: Colour, strength: Value) -> bpy.types.Material:
    """A surface that shines and does nothing else."""
    surface = Surface(name)
    shine = surface.add("Emission", Color=colour, Strength=strength)
    surface.replace(Surface=shine.outputs[0])
    return surface.material


# --- sets -----------------------------------------------------------------------------


def walls(stage: Set) -> None:
    """Floor, a wall to each side of the camera, one at the left; all textured."""
    stage.put(sheet(14, 14), bricks("floor", CREAM, COLD, 1.2))
    stage.put(box(14, 0.1, 5), bricks("wall", WARM, (0.5, 0.2, 0.12)), (0, 4, 0))
    rear = checks("rear", (0.2, 0.55, 0.3), (0.85, 0.85, 0.75), 2.0)
    stage.put(box(14, 0.1, 5), rear, (0, -6, 0))
    stage.put(box(0.1, 14, 5), marble("side", COLD, CREAM, 3.0), (-4.5, 0, 0))


def lamp(stage: Set, watts: float = 420.0) -> bpy.types.Object:
    """A soft lamp above the things."""
    return stage.lamp("AREA", watts, (1.2, -1.2, 4.6), (0, 0.6, 0), size=2.5)


def light(stage: Set, world: float = 0.3) -> bpy.types.Object:
    """A lamp, the same faint light from everywhere, and a camera; returns the lamp."""
    stage.even_world((0.7, 0.85, 1.0), world)
    stage.camera(EYE, TARGET, LENS)
    return lamp(stage)


def boxes(stage: Set) -> list[bpy.types.Object]:
    """Four textured boxes and a ball that stand about; returns them."""
    made = []
    for i, (x, y) in enumerate(((-2.1, 0.3), (-0.9, 1.7), (1.5, 1.4), (2.3, 0.1))):
        stuff = checks(f"box {i}", (0.85, 0.2 + 0.18 * i, 0.1), (0.1, 0.1, 0.2), 6.0)
        made.append(stage.put(box(0.7, 0.7, 0.7), stuff, (x, y, 0), 0.4 * i))
    ball = stage.put(sphere(0.4), marble("ball", LEAF, CREAM), (0.4, 2.4, 0.4))
    return [*made, ball]


def room(stage: Set) -> bpy.types.Object:
    """Walls, light, camera and things: where most shots begin; returns the lamp."""
    walls(stage)
    boxes(stage)
    return light(stage)


def look(stage: Set, eye: Point, target: Point = TARGET) -> None:
    """Let the camera look from somewhere else."""
    aim(stage.scene.camera, eye, target)
