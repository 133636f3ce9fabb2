"""Puts things, lamps, a camera and a world into a scene, without operators."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
from mathutils import Vector

from .geometry import Point, Shape
from .nodes import Colour, World

ORIGIN = (0.0, 0.0, 0.0)


def empty_scene(width: int, height: int) -> bpy.types.Scene:
    """Open an empty file, set up for Cycles pictures of this size in pixels."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    use_cycles(scene, width, height)
    return scene


def use_cycles(scene: bpy.types.Scene, width: int, height: int) -> None:
    """Set a scene up for Cycles pictures of this size: no adaptive sampling."""
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = False


@dataclass
class Builder:
    """Adds to one scene; lengths are metres, angles radians."""

    scene: bpy.types.Scene

    def link(
        self, name: str, data: Any, at: Point = ORIGIN, turn: float = 0.0
    ) -> bpy.types.Object:
        """Add an object with this data, turned about z."""
        thing = bpy.data.objects.new(name, data)
        thing.location, thing.rotation_euler[2] = at, turn
        self.scene.collection.objects.link(thing)
        return thing

    def put(
        self,
        shape: Shape,
        material: bpy.types.Material,
        at: Point = ORIGIN,
        turn: float = 0.0,
        bevel: float = 0.0,
        name: str = "",
        segments: int = 2,
    ) -> bpy.types.Object:
        """Add a shape of one material; `bevel` rounds its edges in `segments` steps."""
        name = name or material.name
        mesh = shape.mesh(name)
        mesh.materials.append(material)
        thing = self.link(name, mesh, at, turn)
        if bevel:
            edge = thing.modifiers.new("Bevel", "BEVEL")
            edge.width, edge.segments, edge.limit_method = bevel, segments, "ANGLE"
        return thing

    def write(
        self,
        text: str,
        size: float,
        material: bpy.types.Material,
        at: Point,
        turn: float = 0.0,
        name: str = "letters",
        **settings: Any,
    ) -> bpy.types.Object:
        """Add upright text in Blender's own font, facing -y before the turn."""
        curve = bpy.data.curves.new(name, "FONT")
        curve.body, curve.size = text, size
        _assign(curve, settings)
        curve.materials.append(material)
        thing = self.link(name, curve, at, turn)
        thing.rotation_euler[0] = math.pi / 2
        return thing

    def lamp(
        self,
        kind: str,
        energy: float,
        at: Point,
        target: Point,
        name: str = "",
        **settings: Any,
    ) -> bpy.types.Object:
        """Add a lamp of a kind (AREA, POINT, SPOT, SUN) that shines at `target`."""
        light = bpy.data.lights.new(name or kind, kind)
        light.energy = energy
        _assign(light, settings)
        thing = self.link(light.name, light)
        aim(thing, at, target)
        return thing

    def camera(self, eye: Point, target: Point, lens: float) -> bpy.types.Object:
        """Add a camera that looks at `target` and make it the scene's."""
        thing = self.link("Camera", bpy.data.cameras.new("Camera"))
        thing.data.lens = lens
        aim(thing, eye, target)
        self.scene.camera = thing
        return thing

    def world(self) -> World:
        """Give the scene a new world; `World.light` sets its light."""
        world = World("World")
        self.scene.world = world.world
        return world

    def even_world(self, colour: Colour, strength: float) -> None:
        """Give the scene the same light from everywhere."""
        self.world().light(colour, strength)


def aim(thing: bpy.types.Object, eye: Point, target: Point, roll: float = 0.0) -> None:
    """Place a camera or lamp at `eye` looking at `target`."""
    thing.location = eye
    way = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y")
    thing.rotation_euler = way.to_euler()
    thing.rotation_euler.rotate_axis("Z", roll)


def _assign(data: Any, settings: dict[str, Any]) -> None:
    for key, value in settings.items():
        setattr(data, key, value)
