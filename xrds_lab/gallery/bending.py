"""Shots of what bends: a figure that walks, shape keys, displacement, cloth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from ..studio.geometry import Point, Shape, joined, sheet, sphere, tube
from .stage import COLD, CREAM, WARM, Set, bake, checks, key, marble, over, room, truck

# Parent, head and tail of each bone, metres above the floor.
_BONES: dict[str, tuple[str, Point, Point]] = {
    "hips": ("", (0, 0, 0.88), (0, 0, 1.08)),
    "chest": ("hips", (0, 0, 1.08), (0, 0, 1.48)),
    "head": ("chest", (0, 0, 1.48), (0, 0, 1.8)),
    "thigh.l": ("hips", (-0.1, 0, 0.9), (-0.1, 0, 0.48)),
    "shin.l": ("thigh.l", (-0.1, 0, 0.48), (-0.1, 0, 0.04)),
    "thigh.r": ("hips", (0.1, 0, 0.9), (0.1, 0, 0.48)),
    "shin.r": ("thigh.r", (0.1, 0, 0.48), (0.1, 0, 0.04)),
    "arm.l": ("chest", (-0.27, 0, 1.4), (-0.27, 0, 0.8)),
    "arm.r": ("chest", (0.27, 0, 1.4), (0.27, 0, 0.8)),
}
# How far each bone swings in the picture's plane, and from where on, in radians.
_SWINGS = {
    "hips": (0.06, 0.0),
    "chest": (0.12, 1.0),
    "head": (0.1, 2.0),
    "thigh.l": (0.42, 0.5),
    "shin.l": (0.3, 1.5),
    "thigh.r": (0.42, 0.5 + math.pi),
    "shin.r": (0.3, 1.5 + math.pi),
    "arm.l": (0.4, 0.5 + math.pi),
    "arm.r": (0.4, 0.5),
}
_PHASE = 0.16  # radians of the walk in a frame
_PACE = 0.04  # metres in a frame, about four pixels


def _limb(x: float, low: float, high: float, radius: float) -> Shape:
    heights = np.linspace(high, low, 14)
    return tube([(x, 0.0, float(z)) for z in heights], radius, 20)


def _parts() -> list[tuple[Shape, list[str]]]:
    """Limbs, each with the bones that bend it."""
    return [
        (_limb(0.0, 0.84, 1.5, 0.2), ["hips", "chest"]),
        (sphere(0.15, 20).moved((0, 0, 1.66)), ["head"]),
        (_limb(-0.1, 0.0, 0.92, 0.085), ["thigh.l", "shin.l"]),
        (_limb(0.1, 0.0, 0.92, 0.085), ["thigh.r", "shin.r"]),
        (_limb(-0.27, 0.78, 1.44, 0.06), ["arm.l"]),
        (_limb(0.27, 0.78, 1.44, 0.06), ["arm.r"]),
    ]


def _skeleton(stage: Set) -> bpy.types.Object:
    rig = stage.link("rig", bpy.data.armatures.new("rig"))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head, tail) in _BONES.items():
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = head, tail
        if parent:
            bone.parent = rig.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def _weights(heights: Any, chain: Sequence[str]) -> Any:
    """How much each bone of a chain moves vertices, (vertices, bones)."""
    ends = [(_BONES[name][1][2], _BONES[name][2][2]) for name in chain]
    near = [
        np.maximum(1.0 - np.abs(heights - (a + b) / 2) / (1.1 * abs(a - b)), 1e-3)
        for a, b in ends
    ]
    return np.stack(near, -1) / np.sum(near, 0)[:, None]


def _skin(body: bpy.types.Object, parts: Sequence[tuple[Shape, list[str]]]) -> None:
    groups = {name: body.vertex_groups.new(name=name) for name in _BONES}
    first = 0
    for shape, chain in parts:
        weights = _weights(shape.vertices[:, 2], chain)
        for number, row in enumerate(weights.tolist()):
            for name, weight in zip(chain, row, strict=True):
                groups[name].add([first + number], weight, "REPLACE")
        first += len(shape.vertices)


def walker(stage: Set, at: Point, hold: int = 1) -> bpy.types.Object:
    """A checked figure that walks to the right, each pose held for `hold` frames."""
    parts, rig = _parts(), _skeleton(stage)
    stuff = checks("cloth", WARM, COLD, 14.0)
    body = stage.put(joined(shape for shape, _ in parts), stuff, name="body")
    _skin(body, parts)
    body.parent = rig
    body.modifiers.new("bend", "ARMATURE").object = rig

    def held(k: int) -> int:
        return hold * (k // hold)

    x, y, z = at
    key(rig, "location", over(lambda k: (x + _PACE * held(k), y, z)), hold > 1)
    for name, (swing, start) in _SWINGS.items():
        bone = rig.pose.bones[name]
        bone.rotation_mode = "XYZ"
        poses = _poses(swing, start, held)
        key(bone, "rotation_euler", poses, hold > 1)
    return rig


def _poses(swing: float, start: float, held: Any) -> dict[int, Point]:
    return over(
        lambda k: (
            0.3 * swing * math.sin(_PHASE * held(k) + 2 * start),
            0.0,
            swing * math.sin(_PHASE * held(k) + start),
        )
    )


def figure(stage: Set) -> None:
    """A figure with a checked texture walks past a camera that stands still."""
    room(stage)
    walker(stage, (0.1, -0.7, 0.0))


def held_poses(stage: Set) -> None:
    """The figure is animated on twos: it moves in every second frame."""
    room(stage)
    walker(stage, (0.1, -0.7, 0.0), hold=2)


def _pushed(shape: Shape, phase: float) -> Any:
    """Vertices of a ball with waves on it."""
    away = shape.vertices / np.linalg.norm(shape.vertices, axis=1, keepdims=True)
    waves = np.sin(5 * away @ np.array((1.0, 0.6, 0.8)) + phase)
    return shape.vertices + 0.1 * waves[:, None] * away


def shape_keys(stage: Set) -> None:
    """A textured ball that changes between three shapes."""
    room(stage)
    ball = sphere(0.75, 48)
    thing = stage.put(ball, checks("ball keys", CREAM, COLD, 9.0), (0.0, -0.5, 0.9))
    thing.shape_key_add(name="Basis")
    for number, swing in enumerate((0.7, 1.3)):
        shape = thing.shape_key_add(name=f"wave {number}")
        points = np.ascontiguousarray(_pushed(ball, 2.0 * number), np.float32)
        shape.data.foreach_set("co", points.ravel())
        values = over(lambda k, s=swing: 0.5 + 0.5 * math.sin(0.25 * k + s))
        key(shape, "value", values)
    truck(stage, 0.02)


def displacement(stage: Set) -> None:
    """A cloth of checks that a texture, which moves, pushes to and fro."""
    room(stage)
    cloth = stage.put(
        sheet(2.2, 1.6, 88, 64), checks("flag", CREAM, WARM, 9.0), (0.0, -0.4, 1.0)
    )
    cloth.rotation_euler = (math.radians(75), 0.0, 0.2)
    noise = bpy.data.textures.new("waves", "CLOUDS")
    noise.noise_scale = 0.6
    place = stage.link("place", None)
    key(place, "location", over(lambda k: (0.05 * k, 0.0, 0.02 * k)))
    push = cloth.modifiers.new("push", "DISPLACE")
    push.texture, push.strength = noise, 0.5
    push.texture_coords, push.texture_coords_object = "OBJECT", place


def cloth(stage: Set) -> None:
    """A cloth that falls over a ball: a baked simulation."""
    room(stage)
    ball = stage.put(sphere(0.55), marble("under", WARM, CREAM), (0.0, -0.4, 0.55))
    ball.modifiers.new("solid", "COLLISION")
    drape = stage.put(
        sheet(1.7, 1.7, 40, 40), checks("drape", CREAM, COLD, 7.0), (0.05, -0.4, 1.25)
    )
    cover = drape.modifiers.new("cloth", "CLOTH")
    cover.settings.quality = 4
    bake(stage, cover.point_cache, -7)
