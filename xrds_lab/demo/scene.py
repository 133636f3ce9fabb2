"""The demo scene: a kitchen still life, built without any other file.

It is made to be hard where super-resolution is: thin text, woven cloth, painted
tiles, wood grain, hammered copper, and glass before a pattern.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Matrix, Vector

from ..studio.builder import ORIGIN, Builder, empty_scene
from ..studio.geometry import Point, Shape, box, curved, lathe, sphere, tube
from . import materials

SHOT = range(1, 10)
"""The frames of the shot that `orbit` makes."""
MIDDLE = 5
"""Its middle frame, which shows the still life as it is built."""
PIVOT = (0.02, 0.1, 0.195)  # what the camera looks at
TURN = 0.4  # degrees per frame about it: 2 to 4 pixels at a width of 960
WALL = 0.62  # y of the tiled wall, metres behind the middle of the table
POT = (0.5, 0.24, 0.0)
BOOKS = (-0.47, 0.16)
CARD = (-0.02, WALL - 0.018)  # x and y of what is written on the recipe card
RECIPE = (
    "Heat a quarter litre of water; wait until it sings.\n"
    "Two spoons of leaves, one for the pot.\n"
    "Pour slowly, count to two hundred and ten,\n"
    "and do not stir. Serve with a slice of lemon.\n"
    "Halve it, quarter it, eighth it: the taste remains."
)
CARAFE = (
    (0.0, 0.0), (0.05, 0.0), (0.072, 0.012), (0.078, 0.06), (0.06, 0.14),
    (0.032, 0.2), (0.028, 0.25), (0.04, 0.285),
)  # fmt: skip
TUMBLER = (
    (0.0, 0.0), (0.03, 0.0), (0.034, 0.004), (0.038, 0.1), (0.0372, 0.101),
    (0.0362, 0.1), (0.0325, 0.014), (0.029, 0.01), (0.0, 0.01),
)  # fmt: skip
KETTLE = (
    (0.0, 0.0), (0.1, 0.0), (0.118, 0.02), (0.122, 0.08), (0.1, 0.135),
    (0.085, 0.142), (0.08, 0.15), (0.05, 0.164), (0.0, 0.17),
)  # fmt: skip
BOWL = (
    (0.0, 0.0), (0.045, 0.0), (0.05, 0.01), (0.1, 0.045), (0.125, 0.095),
    (0.119, 0.095), (0.095, 0.05), (0.045, 0.018), (0.0, 0.015),
)  # fmt: skip


def build(width: int = 960, height: int = 540) -> Any:
    """Empty the file, build the still life and return its scene.

    The picture is `width` x `height` pixels; samples are left to the caller.
    """
    kitchen = Kitchen(empty_scene(width, height))
    scene = kitchen.scene
    scene.cycles.max_bounces = 8
    scene.cycles.blur_glossy = 0.5
    scene.view_settings.view_transform = "Standard"
    _room(kitchen)
    _table_ware(kitchen)
    _fruit(kitchen)
    _books(kitchen)
    _recipe(kitchen)
    _lights(kitchen)
    kitchen.camera((0.06, -1.62, 0.58), PIVOT, 48.0)
    return scene


def orbit(scene: Any) -> None:
    """Make the still life a shot: the camera circles about what it looks at."""
    camera, pivot = scene.camera, Matrix.Translation(Vector(PIVOT))
    scene.frame_start, scene.frame_end = SHOT[0], SHOT[-1]
    bpy.context.view_layer.update()  # a new camera has no place before
    view = camera.matrix_world.copy()
    camera.rotation_mode = "QUATERNION"
    for number in SHOT:
        turn = Matrix.Rotation(math.radians(TURN * (number - MIDDLE)), 4, "Z")
        camera.matrix_world = pivot @ turn @ pivot.inverted() @ view
        camera.keyframe_insert("location", frame=number)
        camera.keyframe_insert("rotation_quaternion", frame=number)
    scene.frame_set(MIDDLE)


class Kitchen(Builder):
    """Things under names of their own, turned by degrees."""

    def stand(
        self,
        name: str,
        shape: Shape,
        material: bpy.types.Material,
        at: Point = ORIGIN,
        degrees: float = 0.0,
        bevel: float = 0.0,
    ) -> bpy.types.Object:
        """Place a shape with finely rounded edges."""
        turn = math.radians(degrees)
        return self.put(shape, material, at, turn, bevel, name, segments=3)


def _room(kitchen: Kitchen) -> None:
    """Table, tiled wall and plaster above it."""
    oak = materials.planks()
    kitchen.stand("Table", box(2.6, 1.2, 0.05), oak, (0.0, 0.02, -0.05), bevel=0.004)
    kitchen.stand(
        "Tiles", box(4.0, 0.05, 0.5), materials.tiles(), (0.0, WALL + 0.025, 0.0)
    )
    kitchen.stand(
        "Wall", box(4.0, 0.05, 1.5), materials.plaster(), (0.0, WALL + 0.035, 0.5)
    )
    kitchen.stand("Rail", box(4.0, 0.04, 0.022), oak, (0.0, WALL, 0.5), bevel=0.004)
    cloth = materials.linen((0.8, 0.76, 0.68), (0.5, 0.06, 0.05))
    kitchen.stand(
        "Cloth", box(0.62, 0.46, 0.003), cloth, (0.16, -0.2, 0.0), 14.0, bevel=0.001
    )


def _table_ware(kitchen: Kitchen) -> None:
    """Carafe, tumbler, bowl and a hammered copper kettle with brass fittings."""
    inside = [(radius - 0.004, height) for radius, height in reversed(CARAFE[2:])]
    hollow = [*curved(CARAFE), *curved([*inside, (0.05, 0.012), (0.0, 0.01)])]
    kitchen.stand("Carafe", lathe(hollow, 96), materials.glass(), (-0.13, 0.1, 0.0))
    tinted = materials.glass((0.86, 0.97, 0.93))
    kitchen.stand("Tumbler", lathe(TUMBLER, 96), tinted, (0.03, -0.02, 0.003))
    clay = materials.stoneware()
    kitchen.stand("Bowl", lathe(curved(BOWL), 96), clay, (0.27, -0.1, 0.003))
    copper = materials.metal((0.93, 0.5, 0.36), 0.16, hammered=True)
    kitchen.stand("Kettle", lathe(curved(KETTLE), 96), copper, POT)
    brass = materials.metal((0.88, 0.66, 0.28), 0.2)
    kitchen.stand("Knob", sphere(0.018), brass, (POT[0], POT[1], 0.185))
    angles = [math.pi * k / 32 for k in range(33)]
    bow = [(0.105 * math.cos(a), 0.0, 0.125 + 0.13 * math.sin(a)) for a in angles]
    kitchen.stand("Handle", tube(bow, 0.006, 16), brass, POT, 25.0)


def _fruit(kitchen: Kitchen) -> None:
    """Oranges and lemons in the bowl and beside it."""
    orange = materials.peel((0.83, 0.27, 0.02), (0.7, 0.16, 0.01))
    lemon = materials.peel((0.86, 0.62, 0.05), (0.72, 0.6, 0.07))
    spots: list[tuple[Any, float, Point]] = [
        (orange, 0.041, (0.235, -0.115, 0.088)),
        (orange, 0.04, (0.312, -0.07, 0.09)),
        (lemon, 0.033, (0.3, -0.15, 0.085)),
        (orange, 0.039, (0.268, -0.098, 0.142)),
        (lemon, 0.032, (0.06, -0.27, 0.034)),
        (orange, 0.042, (-0.36, -0.18, 0.041)),
    ]
    for number, (skin, radius, at) in enumerate(spots):
        fruit = kitchen.stand(f"Fruit {number}", sphere(radius, 64), skin, at)
        fruit.rotation_euler = (0.3 * number, 0.5 * number, number)


def _books(kitchen: Kitchen) -> None:
    """A pile of cloth-bound books, their titles in gold."""
    gold = materials.metal((0.9, 0.7, 0.3), 0.25)
    paper = materials.pages()
    books = [
        ("THE LIGHT FIELD", (0.05, 0.16, 0.14), 0.042, 8.0),
        ("SMALL PRINT & OTHER STORIES", (0.36, 0.07, 0.05), 0.034, -5.0),
        ("ON GRAIN", (0.56, 0.43, 0.24), 0.028, 14.0),
    ]
    level = 0.0
    for title, colour, thick, turn in books:
        dark = (colour[0] * 0.7, colour[1] * 0.7, colour[2] * 0.7)
        cover = materials.linen(colour, dark, 0.004)
        at = (*BOOKS, level)
        for lift in (0.0, thick - 0.004):
            lid = (*BOOKS, level + lift)
            kitchen.stand("Cover", box(0.27, 0.2, 0.004), cover, lid, turn, bevel=0.001)
        leaves = (*BOOKS, level + 0.004)
        kitchen.stand("Pages", box(0.255, 0.19, thick - 0.008), paper, leaves, turn)
        spine = _beside(at, 0.1, turn)
        kitchen.stand("Spine", box(0.27, 0.004, thick), cover, spine, turn, bevel=0.001)
        x, y, z = _beside(at, 0.1028, turn)
        middle = (x, y, z + thick / 2 - 0.005)
        angle = math.radians(turn)
        kitchen.write(title, 0.014, gold, middle, angle, "Title", align_x="CENTER")
        level += thick + 0.001


def _beside(centre: Point, distance: float, degrees: float) -> Point:
    """The place `distance` before `centre`, turned about it."""
    a = math.radians(degrees)
    x, y, z = centre
    return (x + distance * math.sin(a), y - distance * math.cos(a), z)


def _recipe(kitchen: Kitchen) -> None:
    """A framed recipe on the wall, its letters near the limit of the picture."""
    ink = materials.plain("Ink", (0.03, 0.03, 0.035))
    sheet = materials.plain("Sheet", (0.83, 0.79, 0.7), 0.9)
    frame = box(0.46, 0.025, 0.3)
    kitchen.stand(
        "Frame", frame, materials.planks(), (CARD[0], WALL - 0.002, 0.18), bevel=0.004
    )
    kitchen.stand("Card", box(0.42, 0.004, 0.26), sheet, (CARD[0], WALL - 0.015, 0.2))
    heading, lines = (*CARD, 0.405), (*CARD, 0.355)
    kitchen.write("Tea for four", 0.045, ink, heading, align_x="CENTER", name="Heading")
    kitchen.write(RECIPE, 0.0175, ink, lines, align_x="CENTER", name="Recipe")


def _lights(kitchen: Kitchen) -> None:
    """A window on the left, a warm lamp on the right, a dim room around."""
    middle, window, lamp = (0.0, 0.15, 0.1), (-1.7, -0.9, 1.3), (1.3, -0.3, 1.1)
    day, warm = (0.86, 0.93, 1.0), (1.0, 0.72, 0.42)
    kitchen.lamp("AREA", 42.0, window, middle, "Window", size=0.9, color=day)
    kitchen.lamp("AREA", 11.0, lamp, middle, "Lamp", size=0.25, color=warm)
    kitchen.even_world((0.55, 0.6, 0.7), 0.25)
