"""Small scenes that each need something else, to show what may be left out of them.

Each sets a trap for one omission: what it would leave out is seen, if only in a mirror.
`TRAPS` holds the builders by name; every one starts from an empty file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy

from .geometry import Shape, box, sheet, sphere
from .nodes import Nodes

# Where the one thing stands that a scene is about.
PLACE = (1.5, 0.5, 0.0)


def new_room(width: int, height: int) -> bpy.types.Scene:
    """A floor, a red box and a lamp that no camera sees; all of it rough and even."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.cycles.samples = 16
    scene.cycles.use_adaptive_sampling = False
    scene.world = bpy.data.worlds.new("World")
    if not scene.world.node_tree:
        scene.world.use_nodes = True
    put(sheet(12, 12), "Floor", principled(Base_Color=(0.5, 0.5, 0.5)))
    red = principled(Base_Color=(0.8, 0.1, 0.1))
    put(box(1.8, 1.8, 1.8), "Red", red).location = (-1.2, 0.5, 0)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location = 300, 2.0, (0, -3, 5)
    lamp.visible_camera = False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -7.5, 2.6), (math.radians(78), 0, 0)
    for item in (lamp, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    return scene


def put(shape: Shape, name: str, material: bpy.types.Material) -> bpy.types.Object:
    """A new object in the scene."""
    mesh = shape.mesh(name)
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def principled(**inputs: Any) -> bpy.types.Material:
    """A material of one Principled node; inputs as `Nodes.add` takes them."""
    material, nodes, out = bare_material()
    shader = nodes.add("BsdfPrincipled", **inputs)
    nodes.plug(out.inputs["Surface"], shader.outputs[0])
    return material


def bare_material() -> tuple[bpy.types.Material, Nodes, bpy.types.Node]:
    """A material with nothing but its output node."""
    material = bpy.data.materials.new("material")
    if not material.node_tree:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    nodes = Nodes(material.node_tree)
    return material, nodes, nodes.add("OutputMaterial")


def thing(material: bpy.types.Material, shape: Shape | None = None) -> bpy.types.Object:
    """What a scene is about, beside the red box."""
    shape = sphere(0.9).shifted((0, 0, 0.9)) if shape is None else shape
    item = put(shape, "Thing", material)
    item.location = PLACE
    return item


def checked(**inputs: Any) -> bpy.types.Material:
    """A checker of light and dark, otherwise `principled`."""
    material = principled(**inputs)
    nodes = Nodes(material.node_tree)
    shader = material.node_tree.nodes["Principled BSDF"]
    checker = nodes.add("TexChecker", Scale=6.0)
    nodes.plug(shader.inputs["Base Color"], checker.outputs["Color"])
    return material


# --- one builder per scene ------------------------------------------------------------


def plain(scene: bpy.types.Scene) -> None:
    """Even colours on sharp, rough shapes."""
    thing(principled(Base_Color=(0.2, 0.5, 0.8)))


def rough_metal(scene: bpy.types.Scene) -> None:
    """Gloss too rough for guides to follow."""
    thing(principled(Metallic=1.0, Roughness=0.3))


def texture(scene: bpy.types.Scene) -> None:
    """Fine detail in the albedo."""
    thing(checked())


def mirror(scene: bpy.types.Scene) -> None:
    """A texture behind the camera that a mirror alone shows."""
    thing(principled(Metallic=1.0, Roughness=0.0))
    behind = put(sheet(12, 6), "Behind", checked())
    behind.location, behind.rotation_euler = (0, -9, 3), (math.radians(90), 0, 0)


def gloss(scene: bpy.types.Scene) -> None:
    """Gloss just smooth enough for guides to follow."""
    thing(principled(Metallic=1.0, Roughness=0.25))


def glass(scene: bpy.types.Scene) -> None:
    """A glass ball over a texture."""
    thing(principled(Transmission_Weight=1.0, Roughness=0.0))
    bpy.data.objects["Floor"].data.materials[0] = checked()


def lacquer(scene: bpy.types.Scene) -> None:
    """A clear coat on dark, rough paint."""
    thing(principled(Base_Color=(0, 0, 0), Coat_Weight=1.0, Roughness=0.8))


def alpha_card(scene: bpy.types.Scene) -> None:
    """A card that lets most light through, before the rest."""
    material = principled(Alpha=0.3, Base_Color=(0, 0.8, 0.2))
    thing(material, box(1.8, 0.02, 1.8)).location = (0, -1, 0.3)


def screen(scene: bpy.types.Scene) -> None:
    """A texture that shines."""
    material, nodes, out = bare_material()
    checker = nodes.add("TexChecker", Scale=4.0)
    emission = nodes.add("Emission", Color=checker.outputs["Color"])
    nodes.plug(out.inputs["Surface"], emission.outputs[0])
    thing(material, box(1.8, 0.1, 1.8))


def bulb(scene: bpy.types.Scene) -> None:
    """A small bright shape over a glossy floor: light sampling competes with gloss."""
    bpy.data.objects["Floor"].data.materials[0] = principled(
        Metallic=1.0, Roughness=0.2
    )
    material = principled(Emission_Color=(1, 1, 1), Emission_Strength=50.0)
    thing(material, sphere(0.15)).location = (1, 2, 1.5)


def fog(scene: bpy.types.Scene) -> None:
    """A volume in front of a texture."""
    bpy.data.objects["Floor"].data.materials[0] = checked()
    material, nodes, out = bare_material()
    scatter = nodes.add("VolumeScatter", Density=0.5)
    nodes.plug(out.inputs["Volume"], scatter.outputs[0])
    thing(material, box(2, 2, 2)).location = (0, -1, 0.2)


def seen_lamp(scene: bpy.types.Scene) -> None:
    """A lamp that the camera sees."""
    lamp = bpy.data.objects["Lamp"]
    lamp.visible_camera, lamp.location = True, (1.5, 1.0, 2.0)
    lamp.rotation_euler, lamp.data.energy = (math.radians(-90), 0, 0), 5.0


def mirrored_lamp(scene: bpy.types.Scene) -> None:
    """A lamp behind the camera, in a mirror."""
    thing(principled(Metallic=1.0, Roughness=0.0))
    lamp = bpy.data.objects["Lamp"]
    lamp.location, lamp.data.size = (2.5, -9.0, 4.0), 12.0
    lamp.rotation_euler, lamp.data.energy = (math.radians(90), 0, 0), 2000.0


def linked_lamp(scene: bpy.types.Scene) -> None:
    """The same lamp, lighting the mirror alone."""
    mirrored_lamp(scene)
    lit = bpy.data.collections.new("Lit")
    lit.objects.link(bpy.data.objects["Thing"])
    bpy.data.objects["Lamp"].light_linking.receiver_collection = lit


def hidden(scene: bpy.types.Scene) -> None:
    """A box hidden from the camera that a mirror shows."""
    mirror(scene)
    bpy.data.objects["Red"].visible_camera = False


def displaced(scene: bpy.types.Scene) -> None:
    """True displacement under an even colour."""
    material = principled(Base_Color=(0.6, 0.5, 0.4))
    material.displacement_method = "BOTH"
    nodes = Nodes(material.node_tree)
    noise = nodes.add("TexNoise", Scale=4.0)
    height = nodes.add("Displacement", Height=noise.outputs[0], Scale=0.6)
    out = material.node_tree.nodes["Material Output"]
    nodes.plug(out.inputs["Displacement"], height.outputs[0])
    thing(material, sphere(0.9, 64).shifted((0, 0, 0.9)))


def skin(scene: bpy.types.Scene) -> None:
    """Light that goes under the surface."""
    thing(principled(Subsurface_Weight=1.0, Base_Color=(0.9, 0.6, 0.5)))


def sky(scene: bpy.types.Scene) -> None:
    """A background with detail, in a scene without lamps."""
    nodes = Nodes(scene.world.node_tree)
    checker = nodes.add("TexChecker", Scale=8.0)
    background = scene.world.node_tree.nodes["Background"]
    nodes.plug(background.inputs["Color"], checker.outputs["Color"])
    bpy.data.objects.remove(bpy.data.objects["Lamp"])


def still_motion(scene: bpy.types.Scene) -> None:
    """Motion blur is on, but nothing moves."""
    thing(checked())
    scene.render.use_motion_blur = True


def cut_out(scene: bpy.types.Scene) -> None:
    """A product on a transparent film: most of the frame is empty."""
    bpy.data.objects.remove(bpy.data.objects["Floor"])
    bpy.data.objects.remove(bpy.data.objects["Red"])
    thing(checked()).location = (0, 0, 1)
    scene.render.film_transparent = True


TRAPS: dict[str, Callable[[bpy.types.Scene], None]] = {
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
    scene = new_room(width, height)
    TRAPS[name](scene)
    return scene
