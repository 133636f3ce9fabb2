"""Small scenes that each need something else, to show what may be left out of them.

Each sets a trap for one omission: what it would leave out is seen, if only in a mirror.
`TRAPS` holds the builders by name; every one starts from an empty file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy

from .builder import Builder, empty_scene
from .geometry import Point, Shape, box, sheet, sphere
from .nodes import Surface, air, solid

# The one thing that a scene is about, and where it stands.
BALL = sphere(0.9).shifted((0, 0, 0.9))
PLACE = (1.5, 0.5, 0.0)


class Room(Builder):
    """A floor, a red box and a lamp that no camera sees; all of it rough and even."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        super().__init__(scene)
        scene.cycles.samples = 16
        self.world()
        grey = solid("material", Base_Color=(0.5, 0.5, 0.5))
        self.floor = self.put(sheet(12, 12), grey, name="Floor")
        red = solid("material", Base_Color=(0.8, 0.1, 0.1))
        self.red = self.put(box(1.8, 1.8, 1.8), red, (-1.2, 0.5, 0), name="Red")
        above = (0, -3, 5)
        self.area = self.lamp("AREA", 300, above, (0, -3, 0), "Lamp", size=2.0)
        self.area.visible_camera = False
        camera = self.link("Camera", bpy.data.cameras.new("Camera"), (0, -7.5, 2.6))
        camera.rotation_euler = (math.radians(78), 0, 0)
        scene.camera = camera

    def thing(
        self,
        material: bpy.types.Material,
        shape: Shape = BALL,
        at: Point = PLACE,
    ) -> bpy.types.Object:
        """What a scene is about, beside the red box."""
        return self.put(shape, material, at, name="Thing")

    def cover_floor(self, material: bpy.types.Material) -> None:
        """Give the floor another material."""
        self.floor.data.materials[0] = material


def checked(**inputs: Any) -> bpy.types.Material:
    """A checker of light and dark, otherwise `solid`."""
    surface = Surface("material", **inputs)
    surface.set(Base_Color=surface.add("TexChecker", Scale=6.0).outputs["Color"])
    return surface.material


def uniform(**inputs: Any) -> bpy.types.Material:
    """One even material; inputs of the Principled BSDF."""
    return solid("material", **inputs)


# --- one builder per scene ------------------------------------------------------------


def plain(room: Room) -> None:
    """Even colours on sharp, rough shapes."""
    room.thing(uniform(Base_Color=(0.2, 0.5, 0.8)))


def rough_metal(room: Room) -> None:
    """Gloss too rough for guides to follow."""
    room.thing(uniform(Metallic=1.0, Roughness=0.3))


def texture(room: Room) -> None:
    """Fine detail in the albedo."""
    room.thing(checked())


def mirror(room: Room) -> None:
    """A texture behind the camera that a mirror alone shows."""
    room.thing(uniform(Metallic=1.0, Roughness=0.0))
    behind = room.put(sheet(12, 6), checked(), (0, -9, 3), name="Behind")
    behind.rotation_euler[0] = math.radians(90)


def gloss(room: Room) -> None:
    """Gloss just smooth enough for guides to follow."""
    room.thing(uniform(Metallic=1.0, Roughness=0.25))


def glass(room: Room) -> None:
    """A glass ball over a texture."""
    room.thing(uniform(Transmission_Weight=1.0, Roughness=0.0))
    room.cover_floor(checked())


def lacquer(room: Room) -> None:
    """A clear coat on dark, rough paint."""
    room.thing(uniform(Base_Color=(0, 0, 0), Coat_Weight=1.0, Roughness=0.8))


def alpha_card(room: Room) -> None:
    """A card that lets most light through, before the rest."""
    material = uniform(Alpha=0.3, Base_Color=(0, 0.8, 0.2))
    room.thing(material, box(1.8, 0.02, 1.8), (0, -1, 0.3))


def screen(room: Room) -> None:
    """A texture that shines."""
    surface = Surface("material")
    checker = surface.add("TexChecker", Scale=4.0)
    emission = surface.add("Emission", Color=checker.outputs["Color"])
    surface.replace(Surface=emission.outputs[0])
    room.thing(surface.material, box(1.8, 0.1, 1.8))


def bulb(room: Room) -> None:
    """A small bright shape over a glossy floor: light sampling competes with gloss."""
    room.cover_floor(uniform(Metallic=1.0, Roughness=0.2))
    material = uniform(Emission_Color=(1, 1, 1), Emission_Strength=50.0)
    room.thing(material, sphere(0.15), (1, 2, 1.5))


def fog(room: Room) -> None:
    """A volume in front of a texture."""
    room.cover_floor(checked())
    room.thing(air("material", 0.5), box(2, 2, 2), (0, -1, 0.2))


def seen_lamp(room: Room) -> None:
    """A lamp that the camera sees."""
    lamp = room.area
    lamp.visible_camera, lamp.location = True, (1.5, 1.0, 2.0)
    lamp.rotation_euler, lamp.data.energy = (math.radians(-90), 0, 0), 5.0


def mirrored_lamp(room: Room) -> None:
    """A lamp behind the camera, in a mirror."""
    room.thing(uniform(Metallic=1.0, Roughness=0.0))
    lamp = room.area
    lamp.location, lamp.data.size = (2.5, -9.0, 4.0), 12.0
    lamp.rotation_euler, lamp.data.energy = (math.radians(90), 0, 0), 2000.0


def linked_lamp(room: Room) -> None:
    """The same lamp, lighting the mirror alone."""
    mirrored_lamp(room)
    lit = bpy.data.collections.new("Lit")
    lit.objects.link(room.scene.objects["Thing"])
    room.area.light_linking.receiver_collection = lit


def hidden(room: Room) -> None:
    """A box hidden from the camera that a mirror shows."""
    mirror(room)
    room.red.visible_camera = False


def displaced(room: Room) -> None:
    """True displacement under an even colour."""
    surface = Surface("material", Base_Color=(0.6, 0.5, 0.4))
    surface.material.displacement_method = "BOTH"
    noise = surface.add("TexNoise", Scale=4.0)
    height = surface.add("Displacement", Height=noise.outputs[0], Scale=0.6)
    surface.fill(surface.output, Displacement=height.outputs[0])
    room.thing(surface.material, sphere(0.9, 64).shifted((0, 0, 0.9)))


def skin(room: Room) -> None:
    """Light that goes under the surface."""
    room.thing(uniform(Subsurface_Weight=1.0, Base_Color=(0.9, 0.6, 0.5)))


def sky(room: Room) -> None:
    """A background with detail, in a scene without lamps."""
    world = room.world()
    world.light(world.add("TexChecker", Scale=8.0).outputs["Color"])
    bpy.data.objects.remove(room.area)


def still_motion(room: Room) -> None:
    """Motion blur is on, but nothing moves."""
    room.thing(checked())
    room.scene.render.use_motion_blur = True


def cut_out(room: Room) -> None:
    """A product on a transparent film: most of the frame is empty."""
    bpy.data.objects.remove(room.floor)
    bpy.data.objects.remove(room.red)
    room.thing(checked(), at=(0, 0, 1))
    room.scene.render.film_transparent = True


TRAPS: dict[str, Callable[[Room], None]] = {
    build.__name__: build
    for build in (
        plain,
        rough_metal,
        texture,
        mirror,
        gloss,
        glass,
        lacquer,
        alpha_card,
        screen,
        bulb,
        fog,
        seen_lamp,
        mirrored_lamp,
        linked_lamp,
        hidden,
        displaced,
        skin,
        sky,
        still_motion,
        cut_out,
    )
}


def trap(name: str, width: int, height: int) -> bpy.types.Scene:
    """Build one scene by its name in `TRAPS`."""
    room = Room(empty_scene(width, height))
    TRAPS[name](room)
    return room.scene
