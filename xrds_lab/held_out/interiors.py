"""Rooms: by day, under lamps, at night among stalls, and in haze."""

from __future__ import annotations

import math

from ..gallery.stage import glow
from ..studio.geometry import box, joined, rod, sheet, sphere, tube, wall
from ..studio.nodes import air, solid
from ..studio.rooms import Room
from .stage import FIRST, LAST, Set, keyed

_WHITE = (0.8, 0.78, 0.74)
_WARM = (1.0, 0.62, 0.3)


def reading_room(stage: Set) -> None:
    """Daylight through one window; the camera dollies forward."""
    room = Room(5.0, 6.0, 2.7)
    paint = stage.textured("concrete_wall_001", 0.5, Roughness=0.9)
    white = solid("white", Base_Color=_WHITE, Roughness=0.9)
    stage.put(sheet(room.x, room.y), stage.textured("ambientcg_WoodFloor043", 0.6))
    stage.put(sheet(room.x, room.y), white, (0, 0, room.z))
    for number, side in enumerate(room.sides()):
        holes = [(2.6, 0.7, 5.2, 2.3)] if number == 3 else []
        plane = wall(side.length, room.z, holes)
        stage.put(plane, paint if number else white, side.at(0, 0), side.turn)
    bars = [box(0.06, 0.05, 1.6).shifted((2.6 + 0.65 * i, 0, 0.7)) for i in range(5)]
    bars += [box(2.6, 0.05, 0.06).shifted((3.9, 0, 0.7 + 0.77 * i)) for i in range(3)]
    west = room.sides()[3]
    stage.put(joined(bars), white, west.at(0, 0), west.turn)
    stage.put(box(2.6, 1.8, 0.01), stage.textured("materialx_cloth", 2.0), (0, 0.9, 0))
    stage.model("GlamVelvetSofa", 2.0, (0.4, 2.3, 0))
    stage.model("SheenChair", 1.0, (1.6, 0.9, 0), -0.9)
    stage.model("wooden_table_02", 1.1, (0.0, 0.9, 0))
    stage.model("GlassVaseFlowers", 0.45, (0.1, 0.9, 0.77))
    stage.model("wooden_bookshelf_worn", 2.0, (-1.9, 2.75, 0))
    stage.model("painted_wooden_cabinet", 1.3, (2.15, 2.6, 0))
    stage.model("market_library_large", 1.2, (2.2, -0.4, 0), -math.pi / 2)
    stage.sky("immenstadter_horn_1k", 1.6, 1.0)
    stage.lamp("SUN", 5.0, (-5, 1.4, 3.6), (0, 0, 0), angle=0.01, color=(1, 0.93, 0.8))
    start = (1.4, -2.8, 1.5), (-0.3, 1.6, 0.8)
    end = (0.7, -1.6, 1.35), (-0.3, 1.7, 0.75)
    stage.moves(start, end, 24)
    stage.scene.view_settings.exposure = 1.3


def corridor(stage: Set) -> None:
    """A polished floor that mirrors doors and lamps; the camera walks."""
    room = Room(2.4, 18.0, 2.6)
    white = solid("white", Base_Color=_WHITE, Roughness=0.8)
    marble = stage.textured("marble_tiles", 0.5, Roughness=0.08)
    stage.put(sheet(room.x, room.y), marble)
    stage.put(sheet(room.x, room.y), white, (0, 0, room.z))
    bricks = stage.textured("materialx_brick", 0.7)
    for side in room.sides():
        stage.put(wall(side.length, room.z, []), bricks, side.at(0, 0), side.turn)
    wood = stage.textured("rosewood_veneer1", 0.9)
    steel = solid("steel", Base_Color=(0.8, 0.8, 0.82), Metallic=1.0, Roughness=0.25)
    panel = glow("panel", (1.0, 0.95, 0.88), 9.0)
    for number in range(6):
        y = -7.0 + 2.8 * number
        way = 1 if number % 2 else -1
        stage.put(box(0.06, 0.95, 2.1), wood, (1.18 * way, y, 0))
        stage.put(sphere(0.035), steel, (1.12 * way, y + 0.38, 1.0))
        stage.put(box(0.9, 1.1, 0.02), panel, (0, y, room.z - 0.03))
    for place, (name, size) in enumerate(
        (("painted_wooden_stool", 0.5), ("market_cactus", 0.9)) * 2
    ):
        stage.model(name, size, (0.85 - 1.7 * (place % 2), -3.6 + 2.9 * place, 0))
    stage.model("painted_wooden_cabinet_02", 1.2, (-0.9, 3.4, 0), math.pi / 2)
    camera = stage.moves(
        ((0.25, -8.2, 1.6), (0.0, 0, 1.2)), ((0.05, -5.8, 1.6), (-0.1, 2, 1.1)), 26
    )
    step = {frame: 0.03 * math.sin(frame * 0.55) for frame in range(FIRST, LAST + 1, 3)}
    keyed(camera, "delta_location", {f: (x, 0, abs(x)) for f, x in step.items()})


def night_market(stage: Set) -> None:
    """Many small lamps in the dark; the camera pans."""
    stage.put(sheet(30, 30), stage.textured("cobblestone_pavement", 0.45))
    for at, size, turn in (((-5, 6, 0), 6.0, 0.3), ((3.5, 7, 0), 6.5, -0.2)):
        stage.model("village_fantasy_house_01", size, at, turn)
    for at, turn in (
        ((-2.2, 2.6, 0), 0.2),
        ((1.4, 2.9, 0), -0.1),
        ((4.6, 1.8, 0), -0.7),
    ):
        stage.model("village_market_stand_01", 2.5, at, turn)
        torch = (at[0] - 0.2, at[1] - 1.2, 2.2)
        _flame(stage, torch, 60.0)
    for at in ((-3.4, 1.2, 0), (-3.0, 0.9, 0), (2.9, 1.6, 0), (0.3, 3.4, 0)):
        stage.model("village_barrel", 0.8, at, at[0])
    stage.model("village_cart", 2.0, (-0.4, 0.6, 0), 0.8)
    stage.model("village_well", 2.0, (3.1, -0.2, 0))
    stage.model("kaykit_crates_stacked", 1.2, (-4.6, 2.2, 0), 0.4)
    line = [
        (-6 + 0.75 * i, 1.2 + 0.1 * i, 3.3 - 0.5 * math.sin(i * 0.8) ** 2)
        for i in range(17)
    ]
    stage.put(tube(line, 0.01), solid("wire", Base_Color=(0.02, 0.02, 0.02)))
    colours = ((1.0, 0.5, 0.2), (1.0, 0.8, 0.5), (0.3, 0.8, 1.0), (1.0, 0.3, 0.4))
    for number, at in enumerate(line):
        _bulb(stage, at, colours[number % 4], 0.05, 7.0)
    _bulb(stage, (3.1, -0.2, 1.25), _WARM, 0.06, 45.0)
    stage.sky("dikhololo_night_1k", 0.06)
    stage.scene.cycles.use_light_tree = True
    eye = (-0.3, -4.4, 1.7)
    stage.moves((eye, (-3.4, 3.0, 1.3)), (eye, (2.6, 3.0, 1.2)), 28)
    stage.scene.view_settings.exposure = 0.8


def _flame(stage: Set, at: tuple[float, float, float], watts: float) -> None:
    """A torch on a pole."""
    stage.put(
        rod((at[0], at[1], 0), at, 0.03), solid("pole", Base_Color=(0.1, 0.06, 0.03))
    )
    stage.model("kaykit_torch_mounted", 0.6, (at[0], at[1], at[2] - 0.4))
    _bulb(stage, (at[0], at[1] - 0.1, at[2] + 0.2), _WARM, 0.07, watts)


def _bulb(
    stage: Set,
    at: tuple[float, float, float],
    colour: tuple[float, float, float],
    radius: float,
    watts: float,
) -> None:
    """A small ball that shines as a lamp of so many watts does."""
    # a ball of radius r shines with watts / (4 pi^2 r^2) of radiance
    strength = watts / (4.0 * math.pi**2 * radius**2)
    stage.put(sphere(radius, 12), glow("bulb", colour, strength), at)


def smoky_store(stage: Set) -> None:
    """Beams of sun in haze; the camera rises."""
    room = Room(7.0, 8.0, 3.6)
    stone = stage.textured("ambientcg_Rock053", 0.4)
    boards = stage.textured("wood_table_worn", 0.5, Roughness=0.8)
    stage.put(sheet(room.x, room.y), stone)
    stage.put(sheet(room.x, room.y), boards, (0, 0, room.z))
    for number, side in enumerate(room.sides()):
        slots = [(0.9 + 1.0 * i, 1.6, 1.25 + 1.0 * i, 3.2) for i in range(7)]
        plane = wall(side.length, room.z, slots if number == 3 else [])
        stage.put(plane, stone, side.at(0, 0), side.turn)
    for at, turn in (((-1.2, 1.4, 0), 0.0), ((0.2, 2.6, 0), 0.5), ((2.4, 1.2, 0), 1.0)):
        stage.model("kaykit_barrel_large_decorated", 1.1, at, turn)
    stage.model("kaykit_keg_decorated", 1.2, (1.3, 2.9, 0), -0.3)
    stage.model("kaykit_crates_stacked", 1.6, (-2.4, 2.8, 0), 0.2)
    stage.model("kaykit_chest_gold", 1.0, (0.9, 0.6, 0), -0.5)
    stage.model("village_cart", 2.2, (-1.9, -0.4, 0), 1.1)
    posts = [box(0.25, 0.25, room.z).shifted((x, 2.0, 0)) for x in (-1.9, 1.9)]
    stage.put(joined(posts), boards)
    stage.put(box(6.9, 7.9, 3.5), air("haze", 0.09), (0, 0, 0.05))
    stage.lamp("SUN", 45.0, (-5, 0.6, 4.2), (0, 0, 0), angle=0.01, color=(1, 0.9, 0.75))
    stage.lamp(
        "AREA", 120.0, (1.5, -2.5, 3.4), (0, 1, 0), size=1.5, color=(0.7, 0.8, 1)
    )
    stage.even_world((0.4, 0.55, 0.9), 1.0)
    stage.moves(
        ((2.0, -3.4, 0.9), (-0.4, 1.5, 1.1)), ((2.0, -3.2, 2.3), (-0.4, 1.5, 0.5)), 26
    )
    stage.scene.view_settings.exposure = 1.2
