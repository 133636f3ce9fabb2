"""Things on tables and floors, near the camera."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..gallery.stage import glass, mirror
from ..studio.geometry import (
    Point,
    box,
    curved,
    cylinder,
    lathe,
    sheet,
    sphere,
    torus,
    wall,
)
from ..studio.nodes import Surface, solid
from ..studio.rooms import Room
from .stage import FIRST, LAST, Set, keyed, look


def tea_table(stage: Set) -> None:
    """A table in shallow focus; the camera orbits."""
    top = stage.textured("wood_table_worn", 1.2)
    stage.put(cylinder(0.75, 0.04, 96), top, (0, 0, -0.04), bevel=0.01)
    pot = stage.model("tea_set_01", 0.75, (0, 0, 0), 0.4)
    for at, turn in (
        ((0.38, -0.3, 0), 0.5),
        ((0.5, -0.12, 0), 2.0),
        ((-0.45, 0.2, 0), 4.0),
    ):
        stage.model("Avocado", 0.1, at, turn)
    stage.model("market_mug", 0.14, (-0.42, -0.25, 0), 1.0)
    stage.sky("st_fagans_interior_1k", 1.2, 3.6)
    camera = stage.camera((0, -1.2, 0.5), (0, 0, 0.08), 50)
    camera.rotation_mode = "QUATERNION"
    for frame in range(FIRST, LAST + 1, 4):
        angle = 0.012 * (frame - LAST / 2) - 0.3
        eye = 1.35 * math.sin(angle), -1.35 * math.cos(angle), 0.52
        look(camera, eye, (0, 0, 0.07))
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
    camera.data.dof.use_dof, camera.data.dof.focus_object = True, pot
    camera.data.dof.aperture_fstop = 2.0


def metal_and_glass(stage: Set) -> None:
    """What mirrors and bends light, on a turntable under a still camera."""
    stage.put(sheet(12, 12), stage.textured("ambientcg_Marble006", 0.8, Roughness=0.25))
    table = bpy.data.objects.new("turntable", None)
    stage.scene.collection.objects.link(table)
    gold = solid("gold", Base_Color=(0.95, 0.68, 0.3), Metallic=1.0, Roughness=0.18)
    brushed = stage.textured("ambientcg_Metal009", 3.0, Metallic=1.0)
    steel, clear = mirror("steel", 0.05), glass()
    lacquer = solid(
        "lacquer", Base_Color=(0.5, 0.02, 0.03), Coat_Weight=1.0, Roughness=0.4
    )
    vase = lathe(
        curved([(0.0, 0), (0.12, 0.0), (0.17, 0.2), (0.06, 0.42), (0.1, 0.5)]), 64
    )
    bowl = lathe(
        curved([(0.0, 0.02), (0.14, 0.03), (0.22, 0.16), (0.2, 0.16), (0.0, 0.05)]), 64
    )
    things = [
        stage.put(cylinder(0.75, 0.05, 96), brushed, (0, 0, 0), bevel=0.01),
        stage.put(vase, gold, (-0.35, 0.15, 0.05)),
        stage.put(vase, clear, (0.36, 0.2, 0.05)),
        stage.put(bowl, steel, (0.05, -0.3, 0.05)),
        stage.put(sphere(0.1, 48), clear, (-0.25, -0.35, 0.15)),
        stage.put(sphere(0.12, 48), steel, (0.4, -0.2, 0.17)),
        stage.put(sphere(0.13, 48), lacquer, (0.0, 0.42, 0.18)),
        stage.put(torus(0.13, 0.03), gold, (-0.5, -0.1, 0.08)),
        stage.model("WaterBottle", 0.5, (0.05, 0.08, 0.05)),
        stage.model("GlassHurricaneCandleHolder", 0.4, (-0.1, 0.6, 0.05)),
    ]
    for thing in things:
        thing.parent = table
    keyed(table, "rotation_euler", {FIRST: (0, 0, -0.35), LAST: (0, 0, 0.35)})
    stage.sky("studio_small_03_1k", 0.8, 0.5)
    stage.lamp("AREA", 60.0, (-1.8, -0.8, 1.6), (0, 0, 0.2), size=1.2)
    stage.lamp(
        "AREA", 25.0, (1.9, 0.5, 1.2), (0, 0, 0.2), size=0.6, color=(1, 0.8, 0.6)
    )
    stage.camera((0.2, -2.1, 0.85), (0.0, 0.05, 0.2), 45)


def wax_and_fur(stage: Set) -> None:
    """Light under skin and among hairs; the lens zooms and the head turns."""
    cloth = stage.textured("godot_wool", 2.0, Roughness=0.95)
    stage.put(sheet(6, 4), cloth)
    stage.put(sheet(6, 3).rotated("x", math.pi / 2), cloth, (0, 1.4, 1.5))
    head = stage.model("Suzanne", 0.9, (-0.35, 0.1, 0.0), 0.2)
    wax = solid(
        "wax",
        Base_Color=(0.85, 0.5, 0.38),
        Subsurface_Weight=1.0,
        Subsurface_Radius=(1.0, 0.35, 0.2),
        Subsurface_Scale=0.06,
        Roughness=0.35,
    )
    for part in head.children_recursive:
        if part.type == "MESH":
            part.data.materials.clear()
            part.data.materials.append(wax)
    _hairs(stage, (-0.35, 0.16, 0.46), 0.2, 4000, (0.25, 0.09, 0.03), head)
    skin = solid("hide", Base_Color=(0.3, 0.16, 0.07), Roughness=0.8)
    stage.put(sphere(0.24, 32), skin, (0.55, -0.05, 0.28))
    _hairs(stage, (0.55, -0.05, 0.28), 0.24, 6000, (0.55, 0.32, 0.14), None)
    for frame, turn in ((FIRST, -0.1), (LAST, 0.5)):
        keyed(head, "rotation_euler", {frame: (0, 0, turn)})
    stage.sky("blender_studio", 0.35)
    stage.lamp(
        "AREA", 45.0, (-1.8, -0.6, 1.7), (0, 0, 0.4), size=0.8, color=(1, 0.9, 0.8)
    )
    stage.lamp(
        "AREA", 70.0, (1.4, 1.0, 1.3), (0, 0, 0.5), size=0.4, color=(0.7, 0.8, 1)
    )
    camera = stage.camera((0.1, -2.5, 0.75), (0.08, 0, 0.42), 50)
    keyed(camera.data, "lens", {FIRST: 42.0, LAST: 62.0})


def _hairs(
    stage: Set,
    at: Point,
    radius: float,
    count: int,
    colour: tuple[float, float, float],
    parent: bpy.types.Object | None,
) -> None:
    """Bent hairs that stand on a ball; of a cap on its upper part with a parent."""
    dice, points = np.random.default_rng(count), 5
    root = dice.normal(size=(count, 3))
    if parent is not None:
        root[:, 2] = np.abs(root[:, 2]) + 0.2
    root /= np.linalg.norm(root, axis=1, keepdims=True)
    bend = dice.normal(0, 0.35, (count, 3)) - (0, 0, 0.5)
    along = np.linspace(0.0, 1.0, points)[None, :, None]
    length = 0.5 * radius * dice.uniform(0.7, 1.1, (count, 1, 1))
    hair = root[:, None] * radius
    hair = hair + length * (root[:, None] * along + bend[:, None] * along**2)
    curves = bpy.data.hair_curves.new("hairs")
    curves.add_curves([points] * count)
    curves.position_data.foreach_set("vector", hair.astype(np.float32).ravel())
    thickness = curves.attributes.new("radius", "FLOAT", "POINT")
    taper = np.tile(np.linspace(0.0022, 0.0006, points), count)
    thickness.data.foreach_set("value", taper.astype(np.float32))
    surface = Surface("hair")
    shader = surface.add("BsdfHairPrincipled", parametrization="COLOR", Color=colour)
    surface.replace(Surface=shader.outputs[0])
    curves.materials.append(surface.material)
    thing = stage.link("hairs", curves, at)
    if parent is not None:
        bpy.context.view_layer.update()
        thing.parent = parent
        thing.matrix_parent_inverse = parent.matrix_world.inverted()


def toy_race(stage: Set) -> None:
    """Toys that pass before and behind others, under a still camera."""
    room = Room(5.0, 5.0, 2.6)
    stage.put(sheet(room.x, room.y), stage.textured("ambientcg_WoodFloor043", 0.8))
    paper = solid("paper", Base_Color=(0.25, 0.4, 0.45), Roughness=0.9)
    for side in room.sides()[:2]:
        stage.put(wall(side.length, room.z, []), paper, side.at(0, 0), side.turn)
    stage.put(
        box(2.0, 1.2, 0.01), stage.textured("materialx_cloth", 3.0), (0.3, 0.4, 0)
    )
    stage.model("dutch_ship_medium", 0.9, (0.75, 1.5, 0), 0.6)
    stage.model("Fox", 0.5, (-0.75, 0.9, 0), 0.7)
    for at, colour in (
        ((-0.2, 1.5), (0.8, 0.2, 0.1)),
        ((-0.05, 1.35), (0.1, 0.4, 0.7)),
        ((-0.35, 1.3), (0.9, 0.7, 0.1)),
    ):
        block = solid("block", Base_Color=colour, Roughness=0.4)
        stage.put(box(0.14, 0.14, 0.14), block, (*at, 0.0), at[0] * 5, bevel=0.01)
    car = stage.model("ToyCar", 0.45, (0, 0, 0.01), math.pi / 2)
    keyed(car, "location", {FIRST: (-0.9, 0.1, 0.01), LAST: (0.9, 0.0, 0.01)})
    van = stage.model("market_citroen_old_van", 0.5, (0, 0, 0.0), math.pi / 2)
    keyed(van, "location", {FIRST: (0.9, 0.75, 0.01), LAST: (-0.5, 0.7, 0.01)})
    stripes = Surface("stripes", Roughness=0.3)
    bands = stripes.add(
        "TexChecker", Scale=6.0, Color1=(0.8, 0.1, 0.1), Color2=(0.9,) * 3
    )
    stripes.plug(bands.inputs["Vector"], stripes.add("TexCoord").outputs["Object"])
    stripes.set(Base_Color=bands.outputs["Color"])
    ball = stage.put(sphere(0.12, 48), stripes.material, (0, 0, 0.12))
    keyed(ball, "location", {FIRST: (-0.2, -0.45, 0.12), LAST: (0.9, -0.25, 0.12)})
    keyed(ball, "rotation_euler", {FIRST: (0, -4.6, 0), LAST: (0, 4.6, 0)})
    stage.sky("blender_courtyard", 0.5, 2.0)
    stage.lamp("SUN", 2.5, (-2, -2.4, 2.6), (0, 0, 0), angle=0.02, color=(1, 0.92, 0.8))
    stage.camera((-0.1, -2.3, 0.75), (0.0, 0.5, 0.2), 35)
