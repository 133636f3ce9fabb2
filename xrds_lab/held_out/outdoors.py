"""Open ground: a meadow, and a figure that walks through a courtyard."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np

from ..studio.assets import copied
from ..studio.geometry import box, cylinder, joined, quads, sheet, sphere, tube, wall
from ..studio.nodes import Surface, solid
from .stage import FIRST, JUDGED, LAST, Set, keyed

_SPEED = 0.05  # metres a frame: a walk
_STRIDE = 0.26  # radians of a cycle of two steps, a frame


def meadow(stage: Set) -> None:
    """Leaf cards and many instances; a camera in a hand."""
    ground = sheet(60, 60, 60, 60)
    rise = ground.bent(lambda v: v + _hills(v))
    stage.put(rise, stage.textured("sparse_grass", 0.35))
    bark = stage.textured("ambientcg_Bark014", 0.8)
    stage.model("dead_maple_tree", 6.0, (-2.4, 5.0, 0), 0.3)
    for at, size in (((4.5, 8, 0), 5.0), ((-7, 11, 0), 6.0), ((1.2, 14, 0), 6.0)):
        trunk = tube([at, (at[0] + 0.1, at[1], 0.6 * size)], 0.03 * size, 12)
        stage.put(trunk, bark)
        _crown(stage, (at[0], at[1], size * 0.75), size * 0.35)
    for name, size, count in (
        ("fern_02", 1.8, 40),
        ("flowers", 1.5, 40),
        ("fantasy_flower_bushes", 2.2, 8),
        ("moss_01", 1.5, 8),
    ):
        for _ in range(count):
            x, y = stage.rng.uniform(-5, 5), stage.rng.uniform(-2.2, 7)
            turn = stage.rng.uniform(0, 6.3)
            grown = size * stage.rng.uniform(0.6, 1.2)
            stage.model(name, grown, (x, y, float(_height(x, y))), turn)
    _grass(stage, 260)
    stage.sky("rooitou_park_1k", 1.0, 0.4)
    stage.lamp("SUN", 2.5, (3, -2, 4), (0, 0, 0), angle=0.02, color=(1, 0.95, 0.85))
    camera = stage.moves(
        ((0.3, -4.4, 1.35), (0, 4, 1.0)), ((0.1, -3.6, 1.35), (-0.2, 4, 1.1)), 30
    )
    frames = range(FIRST, LAST + 1, 2)
    keyed(camera, "delta_location", {f: _shake(stage, 0.012) for f in frames})
    turned = {f: (1.0, *_shake(stage, 0.004)) for f in frames}
    keyed(camera, "delta_rotation_quaternion", turned)


def _shake(stage: Set, size: float) -> tuple[float, float, float]:
    x, y, z = (stage.rng.gauss(0, size) for _ in range(3))
    return x, y, z


def _height(x: object, y: object) -> np.ndarray:
    x, y = np.asarray(x), np.asarray(y)
    return 0.15 * np.sin(0.7 * x + 0.3 * y) * np.sin(0.5 * y + 1.0)


def _hills(vertices: np.ndarray) -> np.ndarray:
    zero = np.zeros(len(vertices))
    return np.stack([zero, zero, _height(vertices[:, 0], vertices[:, 1])], axis=1)


def _leaf(name: str, colour: tuple[float, float, float]) -> bpy.types.Material:
    """A card whose outline is a leaf, let through by light."""
    surface = Surface(name, Roughness=0.6, Transmission_Weight=0.0)
    place = surface.add("TexCoord").outputs["UV"]
    apart = surface.add("SeparateXYZ", Vector=place)
    away = surface.math("ABSOLUTE", surface.math("SUBTRACT", apart.outputs[0], 0.06))
    shape = surface.math(
        "SINE", surface.math("MULTIPLY", apart.outputs[1], math.pi / 0.2)
    )
    inside = surface.math("LESS_THAN", away, surface.math("MULTIPLY", shape, 0.055))
    surface.set(Base_Color=colour, Alpha=inside)
    return surface.material


def _crown(stage: Set, at: tuple[float, float, float], size: float) -> None:
    """A cloud of leaf cards, 12 by 20 cm each."""
    dice = np.random.default_rng(int(100 * size))
    spots = dice.normal(0, size * 0.5, (6000, 3))
    along = dice.normal(size=(6000, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, dice.normal(size=(6000, 3)))
    across *= 0.12 / np.linalg.norm(across, axis=1, keepdims=True)
    along *= 0.2
    cards = np.stack([spots, spots + across, spots + across + along, spots + along], 1)
    stage.put(quads(cards), _leaf("leaf", (0.12, 0.3, 0.05)), at)


def _grass(stage: Set, count: int) -> None:
    """Tufts of blades: one mesh, placed many times."""
    dice = np.random.default_rng(3)
    foot = np.column_stack([dice.normal(0, 0.12, (120, 2)), np.zeros(120)])
    side = dice.normal(0, 0.006, (120, 3)) * (1, 1, 0)
    tip = foot + np.column_stack(
        [dice.normal(0, 0.06, (120, 2)), dice.uniform(0.12, 0.3, 120)]
    )
    blades = np.stack([foot - side, foot + side, tip, tip], axis=1)
    green = solid("blade", Base_Color=(0.16, 0.32, 0.06), Roughness=0.5)
    first = stage.put(quads(blades), green)
    for number in range(count):
        tuft = copied(first) if number else first
        x, y = stage.rng.uniform(-4, 4), stage.rng.uniform(-3, 5)
        tuft.location = x, y, float(_height(x, y))
        tuft.rotation_euler[2] = stage.rng.uniform(0, 6.3)


# --- the figure -----------------------------------------------------------------------


@dataclass(frozen=True)
class _Limb:
    """A part that hangs from a joint (x, y, z) of its parent and swings about y."""

    name: str
    joint: tuple[float, float, float]
    length: float
    radius: float
    swing: float = 0.0  # radians
    phase: float = 0.0
    bent: float = 0.0  # radians; it bends to one side alone


def walking_figure(stage: Set) -> None:
    """A walk in low sun; the camera goes along."""
    stage.put(sheet(40, 40), stage.textured("cobblestone_pavement", 0.4))
    bricks = stage.textured("godot_bricks", 0.5)
    holes = [(1.5 + 3.5 * i, 0.0, 2.9 + 3.5 * i, 2.5) for i in range(5)]
    stage.put(wall(20, 4.0, holes), bricks, (-10, 4.0, 0))
    stage.put(
        box(20, 0.1, 4.0), solid("dark", Base_Color=(0.05, 0.05, 0.06)), (0, 5.5, 0)
    )
    stage.model("village_well", 1.9, (1.9, 2.4, 0))
    stage.model("painted_wooden_stool", 0.5, (-1.1, 2.9, 0), 0.5)
    stage.model("cypress_tree", 3.4, (-3.0, 3.3, 0))
    stage.model("village_fantasy_house_01", 7.0, (4.5, 10, 0))
    figure = _figure(stage)
    start, end = ((_SPEED * (f - JUDGED), 0.6, 0.0) for f in (FIRST, LAST))
    keyed(figure, "location", {FIRST: start, LAST: end})
    stage.sky("blender_sunset", 0.9, 2.6)
    stage.lamp(
        "SUN", 4.0, (-3, -2.5, 1.6), (0, 0, 0.2), angle=0.01, color=(1, 0.75, 0.5)
    )
    along = 0.8 * _SPEED * (LAST - JUDGED)
    stage.moves(
        ((-along, -3.6, 1.3), (-along + 0.2, 1, 1.0)),
        ((along, -3.5, 1.3), (along + 0.2, 1, 1.0)),
        32,
    )


def _figure(stage: Set) -> bpy.types.Object:
    """A jointed figure of 1.75 m that walks on the spot, facing +x."""
    coat = stage.textured("materialx_cloth", 4.0, Roughness=0.9)
    skin = solid(
        "skin", Base_Color=(0.6, 0.36, 0.26), Subsurface_Weight=0.4, Roughness=0.5
    )
    denim = solid("denim", Base_Color=(0.06, 0.1, 0.22), Roughness=0.8)
    root = bpy.data.objects.new("figure", None)
    stage.scene.collection.objects.link(root)
    trunk = tube([(0, 0, 0.9), (0, 0, 1.15), (0, 0, 1.42)], 0.17, 24)
    parts = [
        stage.put(joined([trunk, sphere(0.17).shifted((0, 0, 1.42))]), coat),
        stage.put(cylinder(0.06, 0.12).shifted((0, 0, 1.5)), skin),
        stage.put(sphere(0.12).shifted((0.01, 0, 1.66)), skin),
    ]
    for part in parts:
        part.parent = root
    for way, phase in ((1, 0.0), (-1, math.pi)):
        y = 0.11 * way
        upper = _Limb("thigh", (0, y, 0.92), 0.45, 0.085, 0.45, phase)
        lower = _Limb("shin", (0, 0, -0.45), 0.45, 0.06, 0.0, phase + 0.9, 0.7)
        thigh = _hung(stage, upper, denim, root)
        shin = _hung(stage, lower, denim, thigh)
        shoe = stage.put(box(0.26, 0.1, 0.08), coat, (0.06, 0, -0.48), bevel=0.02)
        shoe.parent = shin
        arm = _Limb("arm", (0, 0.22 * way, 1.42), 0.3, 0.055, 0.5, phase + math.pi)
        fore = _Limb("forearm", (0, 0, -0.3), 0.3, 0.04, 0.0, phase + math.pi, -0.5)
        _hung(stage, fore, skin, _hung(stage, arm, coat, root))
    return root


def _hung(
    stage: Set, limb: _Limb, material: bpy.types.Material, parent: bpy.types.Object
) -> bpy.types.Object:
    """Hang a limb on its parent and let it swing through the whole shot."""
    bone = tube([(0, 0, 0), (0, 0, -limb.length)], limb.radius, 16)
    ends = [
        sphere(limb.radius, 16),
        sphere(limb.radius, 16).shifted((0, 0, -limb.length)),
    ]
    thing = stage.put(joined([bone, *ends]), material, limb.joint, name=limb.name)
    thing.parent = parent
    turned = {}
    for frame in range(FIRST - 3, LAST + 4, 2):
        cycle = _STRIDE * (frame - FIRST) + limb.phase
        bend = limb.bent * 0.5 * (1 + math.sin(cycle))
        turned[frame] = (0.0, limb.swing * math.sin(cycle) + bend, 0.0)
    keyed(thing, "rotation_euler", turned)
    return thing
