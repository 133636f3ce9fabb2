"""Put shapes, words and lamps into the scene without operators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ..studio.geometry import Shape

Point = tuple[float, float, float]
Profile = Sequence[tuple[float, float]]


def place(name: str, data: Any, at: Point = (0.0, 0.0, 0.0), turn: float = 0.0) -> Any:
    """Link a new object at `at` (metres), turned about z by `turn` degrees."""
    thing = bpy.data.objects.new(name, data)
    thing.location = at
    thing.rotation_euler = (0.0, 0.0, math.radians(turn))
    bpy.context.scene.collection.objects.link(thing)
    return thing


def put(
    name: str,
    shape: Shape,
    material: Any,
    at: Point = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    bevel: float = 0.0,
) -> Any:
    """Place a shape of one material, its edges rounded by `bevel` metres."""
    data = shape.mesh(name)
    data.materials.append(material)
    thing = place(name, data, at, turn)
    if bevel:
        rounding = thing.modifiers.new("Rounding", "BEVEL")
        rounding.width = bevel
        rounding.segments = 3
    return thing


def curved(points: Profile, steps: int = 8) -> list[tuple[float, float]]:
    """Draw a Catmull-Rom curve through the (radius, height) points of a profile."""
    ends = np.array([points[0], *points, points[-1]], float)
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    pieces = [
        b
        + 0.5 * (c - a) * t
        + (a - 2.5 * b + 2 * c - 0.5 * d) * t**2
        + 0.5 * (3 * b - a - 3 * c + d) * t**3
        for a, b, c, d in zip(ends, ends[1:], ends[2:], ends[3:], strict=False)
    ]
    curve = np.concatenate([*pieces, ends[-1:]])
    curve[:, 0] = curve[:, 0].clip(0.0)
    return [(float(radius), float(height)) for radius, height in curve]


def write(name: str, words: str, size: float, material: Any, at: Point) -> Any:
    """Write in Blender's own font, letters `size` metres high, facing -y."""
    curve = bpy.data.curves.new(name, "FONT")
    curve.body = words
    curve.size = size
    curve.align_x = "CENTER"
    curve.materials.append(material)
    thing = place(name, curve, at)
    thing.rotation_euler[0] = math.radians(90.0)
    return thing


def aim(thing: Any, at: Point) -> None:
    """Point the -z axis of a camera or lamp at a place."""
    away = Vector(at) - thing.location
    thing.rotation_euler = away.to_track_quat("-Z", "Y").to_euler()


def hang(
    name: str, at: Point, aimed: Point, size: float, watts: float, colour: Point
) -> Any:
    """Hang a square area light of `size` metres and aim it."""
    lamp = bpy.data.lights.new(name, "AREA")
    lamp.size = size
    lamp.energy = watts
    lamp.color = colour
    thing = place(name, lamp, at)
    aim(thing, aimed)
    return thing
