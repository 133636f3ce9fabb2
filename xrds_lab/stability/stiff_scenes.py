"""Small procedural scenes with light that is hard on renderers and networks.

Each function fills an empty scene. They need Blender.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np

from ..studio.builder import Builder, empty_scene
from ..studio.geometry import box, joined, rod, sheet, sphere, torus, tube
from ..studio.nodes import Colour, Surface, air, solid

GREY: Colour = (0.5, 0.5, 0.5)
LENS = 35.0  # mm


def checker(size: float, light: Colour = (0.8, 0.8, 0.8)) -> bpy.types.Material:
    """A material of light and dark squares of `size` metres."""
    surface = Surface("checker", Roughness=0.8)
    place = surface.add("NewGeometry").outputs["Position"]
    # off the level of the floor: checks flicker where a coordinate is exactly 0
    lifted = surface.add("VectorMath", Vector=place)
    lifted.inputs[1].default_value = (0.013, 0.017, 0.21 * size)
    squares = surface.add(
        "TexChecker",
        Vector=lifted.outputs[0],
        Scale=1.0 / size,
        Color1=light,
        Color2=(0.05, 0.05, 0.06),
    )
    surface.set(Base_Color=squares.outputs["Color"])
    return surface.material


def still(stage: Builder) -> None:
    """A still life for the others to start from: floor, ball, ring and block."""
    stage.even_world((0.5, 0.65, 0.9), 0.4)
    stage.put(sheet(30, 30), checker(0.4), (0, 0, 0))
    stage.put(sphere(0.6), solid("red", Base_Color=(0.7, 0.1, 0.08)), (-0.9, 0, 0.6))
    steel = solid("steel", Base_Color=GREY, Metallic=1.0, Roughness=0.15)
    stage.put(torus(0.5, 0.15), steel, (0.6, -0.5, 0.15))
    stage.put(box(0.8, 0.8, 1.3), checker(0.12, (0.2, 0.5, 0.7)), (0.8, 0.9, 0))
    stage.lamp("AREA", 250, (2, -3, 4), (0, 0, 0), size=0.5)
    stage.camera((0, -5, 2), (0, 0, 0.5), LENS)


def pinhole(stage: Builder) -> None:
    """A sun through a small hole in the wall of a dark room."""
    stage.even_world((0.4, 0.6, 1.0), 0.02)
    wall, hole = solid("wall", Base_Color=(0.7, 0.66, 0.6)), 0.16
    side = (4 - hole) / 2
    frame = [
        box(side, 0.1, 3).moved((-(hole + side) / 2, 0, 0)),
        box(side, 0.1, 3).moved(((hole + side) / 2, 0, 0)),
        box(hole, 0.1, 1.6),
        box(hole, 0.1, 1.4 - hole).moved((0, 0, 1.6 + hole)),
    ]
    stage.put(joined(frame), wall, (0, 2, 0))
    for at, size in (((-2, 0, 0), (0.1, 4, 3)), ((2, 0, 0), (0.1, 4, 3))):
        stage.put(box(*size), wall, at)
    stage.put(box(4, 0.1, 3), wall, (0, -2, 0))
    stage.put(box(4, 4, 0.1), wall, (0, 0, 3))
    stage.put(sheet(4, 4), checker(0.25), (0, 0, 0))
    stage.put(
        box(0.5, 0.5, 0.6),
        solid("box", Base_Color=(0.3, 0.5, 0.2)),
        (1, 0.8, 0),
    )
    stage.lamp("SUN", 20000, (0, 5, 4.6), (0, 0, 0), angle=0.009)
    stage.camera((-1.4, -1.7, 1.5), (0.4, 1.2, 0.6), 24)


def caustics(stage: Builder) -> None:
    """Light accumulated by glass and by a ring of metal."""
    still(stage)
    glass = solid("glass", Transmission_Weight=1.0, Roughness=0.0, IOR=1.5)
    stage.put(sphere(0.45), glass, (-0.1, -1.4, 0.45))
    stage.lamp("SPOT", 3000, (-2, 2, 3), (0, -1, 0), shadow_soft_size=0.02)
    cycles = stage.scene.cycles
    cycles.caustics_refractive = cycles.caustics_reflective = True


def bright_sky(stage: Builder) -> None:
    """A sky with its sun, of strength 60000, in the picture."""
    still(stage)
    nodes = stage.world()
    way = nodes.add("TexCoord").outputs["Generated"]
    dot = nodes.add("VectorMath", operation="DOT_PRODUCT", Vector=way)
    sun = np.array((0.25, 1.0, 0.16))
    dot.inputs[1].default_value = tuple(sun / np.linalg.norm(sun))
    inside = nodes.math(
        "GREATER_THAN", dot.outputs["Value"], math.cos(math.radians(0.6))
    )
    strength = nodes.math("ADD", nodes.math("MULTIPLY", inside, 60000.0), 1.0)
    nodes.light((0.4, 0.6, 1.0), strength)
    stage.camera((0, -5, 1.0), (0.4, 0, 1.1), 28)


def emitter(stage: Builder) -> None:
    """A small ball that shines with 1e5, in view."""
    still(stage)
    shine = solid("shine", Emission_Color=(1.0, 0.8, 0.5), Emission_Strength=1e5)
    stage.put(sphere(0.012, 16), shine, (0.1, -0.4, 1.2))


def glass_in_glass(stage: Builder) -> None:
    """A ball of glass in a shell of glass in a block of glass."""
    still(stage)
    for radius, index in ((0.7, 1.5), (0.55, 1.0), (0.35, 1.8)):
        glass = solid("glass", Transmission_Weight=1.0, Roughness=0.0, IOR=index)
        stage.put(sphere(radius), glass, (0, -1.2, 0.72))


def fog(stage: Builder) -> None:
    """A spot light's cone in scattering air."""
    still(stage)
    stage.put(box(8, 8, 4), air("air", 0.15), (0, 0, -0.1))
    stage.lamp("SPOT", 4000, (-2, 1, 3.4), (0.5, -0.5, 0), spot_size=0.6)


def hair(stage: Builder) -> None:
    """Hairs far thinner than a pixel, on a ball before a bright wall."""
    still(stage)
    random = np.random.default_rng(5)
    strands = []
    for way in random.normal(size=(500, 3)):
        root = way / np.linalg.norm(way)
        tip = root * 1.7 + (0, 0, -0.25)
        strands.append(tube([root * 0.55, root * 1.2, tip], 0.0015, 4))
    fur = solid("fur", Base_Color=(0.12, 0.05, 0.02), Roughness=0.35)
    stage.put(joined(strands), fur, (-0.4, -1.0, 0.9))


def horizon(stage: Builder) -> None:
    """Small checks to the horizon."""
    stage.even_world((0.6, 0.7, 0.9), 1.0)
    stage.put(sheet(400, 400), checker(0.25), (0, 190, 0))
    chrome = solid("chrome", Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0)
    stage.put(sphere(0.5), chrome, (0, 0.5, 0.5))
    stage.lamp("SUN", 3, (3, -2, 5), (0, 0, 0), angle=0.01)
    stage.camera((0, -3, 0.9), (0, 1, 0.6), 28)


def blurred(stage: Builder) -> None:
    """A shallow lens and things that move."""
    still(stage)
    lens = stage.scene.camera.data
    lens.dof.use_dof = True
    lens.dof.focus_distance, lens.dof.aperture_fstop = 4.2, 0.4
    moving = stage.put(sphere(0.3), checker(0.1, (0.9, 0.5, 0.1)), (-0.2, -1.5, 0.9))
    for frame, x in ((0, -0.9), (2, 0.5)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    stage.scene.render.use_motion_blur = True
    stage.scene.frame_set(1)


def soft_alpha(stage: Builder) -> None:
    """Nothing behind thin rods and a sheet that light half passes."""
    stage.even_world((0.6, 0.7, 0.9), 0.8)
    rods = [
        rod((-1.5 + 0.12 * i, 0, 0), (-1.2 + 0.12 * i, 0.3, 2), 0.004)
        for i in range(26)
    ]
    stage.put(joined(rods), solid("rods", Base_Color=(0.8, 0.6, 0.2)), (0, 0, 0))
    veil = solid("veil", Base_Color=(0.7, 0.1, 0.2), Alpha=0.4)
    stage.put(sphere(0.7), veil, (0.5, -0.6, 1.0))
    stage.put(box(0.8, 0.6, 0.7), checker(0.1), (-0.8, -0.6, 0.2))
    stage.lamp("AREA", 200, (2, -3, 4), (0, 0, 1), size=0.5)
    stage.camera((0, -4.5, 1.3), (0, 0, 1), LENS)
    stage.scene.render.film_transparent = True


SCENES: dict[str, Callable[[Builder], None]] = {
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


def build(name: str, side: int) -> bpy.types.Scene:
    """Open an empty file, build a scene in it and return it; `side` in pixels."""
    from xrds_blender.interface.registration import ensure_registered

    scene = empty_scene(side, side)
    ensure_registered()
    SCENES[name](Builder(scene))
    scene.cycles.sample_clamp_indirect = 0.0  # nothing is cut off before it is measured
    return scene
