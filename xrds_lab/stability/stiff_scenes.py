"""Small procedural scenes with light that is hard on renderers and networks.

Each function fills an empty scene. They need Blender.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from ..studio.geometry import Shape, box, joined, rod, sheet, sphere, torus, tube
from ..studio.nodes import Nodes
from ..studio.stage import aim

Colour = tuple[float, float, float]

GREY: Colour = (0.5, 0.5, 0.5)


def material(name: str, **inputs: Any) -> Any:
    """Return a principled material; spaces of its inputs' names are underscores."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        rgba = (*value, 1.0) if isinstance(value, tuple) else value
        shader.inputs[key.replace("_", " ")].default_value = rgba
    return made


def checker(size: float, light: Colour = (0.8, 0.8, 0.8)) -> Any:
    """Return a material of light and dark squares of ``size`` metres."""
    made = material("checker", Roughness=0.8)
    nodes = Nodes(made.node_tree)
    place = nodes.add("NewGeometry").outputs["Position"]
    # off the level of the floor: checks flicker where a coordinate is exactly 0
    lifted = nodes.add("VectorMath", Vector=place)
    lifted.inputs[1].default_value = (0.013, 0.017, 0.21 * size)
    squares = nodes.add("TexChecker", Vector=lifted.outputs[0])
    squares.inputs["Scale"].default_value = 1.0 / size
    squares.inputs["Color1"].default_value = (*light, 1.0)
    squares.inputs["Color2"].default_value = (0.05, 0.05, 0.06, 1.0)
    shader = made.node_tree.nodes["Principled BSDF"]
    made.node_tree.links.new(squares.outputs["Color"], shader.inputs["Base Color"])
    return made


def put(scene: Any, shape: Shape, paint: Any, at: tuple[float, float, float]) -> Any:
    """Add a shape to the scene and return the object."""
    mesh = shape.mesh(paint.name)
    mesh.materials.append(paint)
    thing = bpy.data.objects.new(paint.name, mesh)
    thing.location = at
    scene.collection.objects.link(thing)
    return thing


def lamp(
    scene: Any, kind: str, energy: float, at: Any, target: Any, **more: Any
) -> Any:
    """Add a lamp at a place, shining at another."""
    light = bpy.data.lights.new(kind, kind)
    light.energy = energy
    for key, value in more.items():
        setattr(light, key, value)
    thing = bpy.data.objects.new(kind, light)
    scene.collection.objects.link(thing)
    aim(thing, at, target)
    return thing


def look(scene: Any, eye: Any, target: Any, lens: float = 35.0) -> Any:
    """Place the scene's camera."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.data.lens = lens
    aim(camera, eye, target)
    scene.camera = camera
    return camera.data


def world(scene: Any, colour: Colour, strength: float) -> Any:
    """Give the scene even light from everywhere; returns its node tree."""
    made = bpy.data.worlds.new("World")
    made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*colour, 1.0)
    background.inputs["Strength"].default_value = strength
    scene.world = made
    return made.node_tree


def still(scene: Any) -> None:
    """A still life for the others to start from: floor, ball, ring and block."""
    world(scene, (0.5, 0.65, 0.9), 0.4)
    put(scene, sheet(30, 30), checker(0.4), (0, 0, 0))
    put(
        scene, sphere(0.6), material("red", Base_Color=(0.7, 0.1, 0.08)), (-0.9, 0, 0.6)
    )
    steel = material("steel", Base_Color=GREY, Metallic=1.0, Roughness=0.15)
    put(scene, torus(0.5, 0.15), steel, (0.6, -0.5, 0.15))
    put(scene, box(0.8, 0.8, 1.3), checker(0.12, (0.2, 0.5, 0.7)), (0.8, 0.9, 0))
    lamp(scene, "AREA", 250, (2, -3, 4), (0, 0, 0), size=0.5)
    look(scene, (0, -5, 2), (0, 0, 0.5))


def pinhole(scene: Any) -> None:
    """A sun through a small hole in the wall of a dark room."""
    world(scene, (0.4, 0.6, 1.0), 0.02)
    wall, hole = material("wall", Base_Color=(0.7, 0.66, 0.6)), 0.16
    side = (4 - hole) / 2
    frame = [
        box(side, 0.1, 3).moved((-(hole + side) / 2, 0, 0)),
        box(side, 0.1, 3).moved(((hole + side) / 2, 0, 0)),
        box(hole, 0.1, 1.6),
        box(hole, 0.1, 1.4 - hole).moved((0, 0, 1.6 + hole)),
    ]
    put(scene, joined(frame), wall, (0, 2, 0))
    for at, size in (((-2, 0, 0), (0.1, 4, 3)), ((2, 0, 0), (0.1, 4, 3))):
        put(scene, box(*size), wall, at)
    put(scene, box(4, 0.1, 3), wall, (0, -2, 0))
    put(scene, box(4, 4, 0.1), wall, (0, 0, 3))
    put(scene, sheet(4, 4), checker(0.25), (0, 0, 0))
    put(
        scene,
        box(0.5, 0.5, 0.6),
        material("box", Base_Color=(0.3, 0.5, 0.2)),
        (1, 0.8, 0),
    )
    lamp(scene, "SUN", 20000, (0, 5, 4.6), (0, 0, 0), angle=0.009)
    look(scene, (-1.4, -1.7, 1.5), (0.4, 1.2, 0.6), 24)


def caustics(scene: Any) -> None:
    """Light gathered by glass and by a ring of metal."""
    still(scene)
    glass = material("glass", Transmission_Weight=1.0, Roughness=0.0, IOR=1.5)
    put(scene, sphere(0.45), glass, (-0.1, -1.4, 0.45))
    lamp(scene, "SPOT", 3000, (-2, 2, 3), (0, -1, 0), shadow_soft_size=0.02)
    scene.cycles.caustics_refractive = scene.cycles.caustics_reflective = True


def bright_sky(scene: Any) -> None:
    """A sky whose sun, of 60000, stands in the picture."""
    still(scene)
    tree = world(scene, (0.4, 0.6, 1.0), 1.0)
    nodes = Nodes(tree)
    way = nodes.add("TexCoord").outputs["Generated"]
    dot = nodes.add("VectorMath", operation="DOT_PRODUCT", Vector=way)
    sun = np.array((0.25, 1.0, 0.16))
    dot.inputs[1].default_value = tuple(sun / np.linalg.norm(sun))
    inside = nodes.math(
        "GREATER_THAN", dot.outputs["Value"], math.cos(math.radians(0.6))
    )
    strength = nodes.math("ADD", nodes.math("MULTIPLY", inside, 60000.0), 1.0)
    background = tree.nodes["Background"]
    tree.links.new(strength, background.inputs["Strength"])
    look(scene, (0, -5, 1.0), (0.4, 0, 1.1), 28)


def emitter(scene: Any) -> None:
    """A small ball that shines with 1e5, in view."""
    still(scene)
    shine = material("shine", Emission_Color=(1.0, 0.8, 0.5), Emission_Strength=1e5)
    put(scene, sphere(0.012, 16), shine, (0.1, -0.4, 1.2))


def glass_in_glass(scene: Any) -> None:
    """A ball of glass in a shell of glass in a block of glass."""
    still(scene)
    for radius, index in ((0.7, 1.5), (0.55, 1.0), (0.35, 1.8)):
        glass = material("glass", Transmission_Weight=1.0, Roughness=0.0, IOR=index)
        put(scene, sphere(radius), glass, (0, -1.2, 0.72))


def fog(scene: Any) -> None:
    """A spot light's cone in scattering air."""
    still(scene)
    air = bpy.data.materials.new("air")
    air.use_nodes = True
    tree = air.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Density"].default_value = 0.15
    output = tree.nodes["Material Output"]
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    put(scene, box(8, 8, 4), air, (0, 0, -0.1))
    lamp(scene, "SPOT", 4000, (-2, 1, 3.4), (0.5, -0.5, 0), spot_size=0.6)


def hair(scene: Any) -> None:
    """Hairs far thinner than a pixel, on a ball before a bright wall."""
    still(scene)
    random = np.random.default_rng(5)
    strands = []
    for way in random.normal(size=(500, 3)):
        root = way / np.linalg.norm(way)
        tip = root * 1.7 + (0, 0, -0.25)
        strands.append(tube([root * 0.55, root * 1.2, tip], 0.0015, 4))
    fur = material("fur", Base_Color=(0.12, 0.05, 0.02), Roughness=0.35)
    put(scene, joined(strands), fur, (-0.4, -1.0, 0.9))


def horizon(scene: Any) -> None:
    """Small checks to the horizon."""
    world(scene, (0.6, 0.7, 0.9), 1.0)
    put(scene, sheet(400, 400), checker(0.25), (0, 190, 0))
    chrome = material("chrome", Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0)
    put(scene, sphere(0.5), chrome, (0, 0.5, 0.5))
    lamp(scene, "SUN", 3, (3, -2, 5), (0, 0, 0), angle=0.01)
    look(scene, (0, -3, 0.9), (0, 1, 0.6), 28)


def blurred(scene: Any) -> None:
    """A shallow lens and things that move."""
    still(scene)
    lens = scene.camera.data
    lens.dof.use_dof = True
    lens.dof.focus_distance, lens.dof.aperture_fstop = 4.2, 0.4
    moving = put(scene, sphere(0.3), checker(0.1, (0.9, 0.5, 0.1)), (-0.2, -1.5, 0.9))
    for frame, x in ((0, -0.9), (2, 0.5)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    scene.render.use_motion_blur = True
    scene.frame_set(1)


def soft_alpha(scene: Any) -> None:
    """Nothing behind thin rods and a sheet that light half passes."""
    world(scene, (0.6, 0.7, 0.9), 0.8)
    rods = [
        rod((-1.5 + 0.12 * i, 0, 0), (-1.2 + 0.12 * i, 0.3, 2), 0.004)
        for i in range(26)
    ]
    put(scene, joined(rods), material("rods", Base_Color=(0.8, 0.6, 0.2)), (0, 0, 0))
    veil = material("veil", Base_Color=(0.7, 0.1, 0.2), Alpha=0.4)
    put(scene, sphere(0.7), veil, (0.5, -0.6, 1.0))
    put(scene, box(0.8, 0.6, 0.7), checker(0.1), (-0.8, -0.6, 0.2))
    lamp(scene, "AREA", 200, (2, -3, 4), (0, 0, 1), size=0.5)
    look(scene, (0, -4.5, 1.3), (0, 0, 1))
    scene.render.film_transparent = True


Builder = Callable[[Any], None]

SCENES: dict[str, Builder] = {
    "pinhole": pinhole,
    "caustics": caustics,
    "bright_sky": bright_sky,
    "emitter": emitter,
    "glass_in_glass": glass_in_glass,
    "one_sample": still,
    "fog": fog,
    "hair": hair,
    "horizon": horizon,
    "blurred": blurred,
    "soft_alpha": soft_alpha,
}


def build(name: str, side: int) -> Any:
    """Open an empty file, build a scene in it and return it; ``side`` in pixels."""
    from xrds_blender.interface.registration import ensure_registered

    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()
    scene = bpy.context.scene
    SCENES[name](scene)
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = side
    render.resolution_percentage = 100
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.device = "CPU"
    scene.cycles.sample_clamp_indirect = 0.0  # nothing is cut off before it is measured
    return scene
