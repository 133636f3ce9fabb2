"""Interiors: rooms with windows, furniture, lamps, stairs and clutter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from . import lighting, props
from .geometry import Shape, box, joined, rod, sheet, wall
from .stage import Stage, turned


@dataclass(frozen=True)
class Side:
    """One wall: its left end seen from inside, the turn of its plane, its length."""

    x: float
    y: float
    turn: float
    length: float

    def at(
        self, along: float, height: float, off: float = 0.0
    ) -> tuple[float, float, float]:
        """A point `along` the wall, `off` metres into the room."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        return (self.x + c * along + s * off, self.y + s * along - c * off, height)


@dataclass(frozen=True)
class Room:
    """Inner measures of a room centred on the origin."""

    x: float
    y: float
    z: float

    def sides(self) -> list[Side]:
        """The walls, in the order north, east, south, west."""
        x, y = self.x / 2, self.y / 2
        return [
            Side(-x, y, 0.0, self.x),
            Side(x, y, -math.pi / 2, self.y),
            Side(x, -y, math.pi, self.x),
            Side(-x, -y, math.pi / 2, self.y),
        ]

    def spot(self, stage: Stage, margin: float = 0.5) -> tuple[float, float, float]:
        """A random place on the floor."""
        x, y = self.x / 2 - margin, self.y / 2 - margin
        return (stage.rng.uniform(-x, x), stage.rng.uniform(-y, y), 0.0)


def build(stage: Stage) -> None:
    """A furnished room lit by its windows, by lamps, or by both."""
    rng = stage.rng
    room = Room(rng.uniform(3, 8), rng.uniform(3.5, 8), rng.uniform(2.4, 3.6))
    _shell(stage, room)
    _furnish(stage, room)
    _decorate(stage, room)
    _light(stage, room)
    _views(stage, room)


def _shell(stage: Stage, room: Room) -> None:
    stage.put(sheet(room.x, room.y), stage.paint.floor())
    ceiling = stage.paint.plaster() if stage.chance(0.8) else stage.paint.wood()
    stage.put(sheet(room.x, room.y), ceiling, (0, 0, room.z))
    main = stage.paint.wall()
    for side in room.sides():
        paper = main if stage.chance(0.75) else stage.paint.wall()
        holes = _windows(stage, side, room.z) if stage.chance(0.55) else []
        stage.put(wall(side.length, room.z, holes), paper, side.at(0, 0), side.turn)
        _skirting(stage, side, room.z)


def _skirting(stage: Stage, side: Side, height: float) -> None:
    bars = [box(side.length, 0.02, 0.1).shifted((side.length / 2, -0.01, 0))]
    if stage.chance(0.4):
        bars.append(
            box(side.length, 0.05, 0.06).shifted(
                (side.length / 2, -0.025, height - 0.06)
            )
        )
    if stage.chance(0.2):
        bars.append(box(side.length, 0.02, 0.05).shifted((side.length / 2, -0.01, 0.9)))
    stage.put(joined(bars), stage.paint.painted(), side.at(0, 0), side.turn)


def _windows(stage: Stage, side: Side, height: float) -> list[tuple[float, ...]]:
    rng, count = stage.rng, stage.rng.randint(1, 3)
    wide = min(rng.uniform(0.7, 2.2), side.length / count - 0.4)
    low, high = rng.choice((0.0, 0.5, 0.9)) + 0.05, height - rng.uniform(0.2, 0.6)
    holes = []
    for i in range(count):
        middle = side.length * (i + 0.5) / count
        holes.append((middle - wide / 2, low, middle + wide / 2, high))
    frame, dressed = stage.paint.painted(), rng.random()
    for x0, z0, x1, z1 in holes:
        at, x, z = side.at((x0 + x1) / 2, z0), x1 - x0, z1 - z0
        stage.put(_frame(stage, x, z), frame, at, side.turn)
        _dress(stage, side, at, x, z, dressed)
    return holes


def _frame(stage: Stage, x: float, z: float) -> Shape:
    edge, rng = stage.rng.uniform(0.03, 0.07), stage.rng
    bars = [box(edge, 0.16, z).shifted((i * x / 2, 0.07, 0)) for i in (-1, 1)]
    bars += [box(x, 0.16, edge).shifted((0, 0.07, k)) for k in (0, z - edge)]
    bars.append(box(x + 0.2, 0.25, 0.03).shifted((0, 0, -0.03)))
    for i in range(1, rng.randint(1, 4)):
        bars.append(box(edge * 0.6, 0.04, z).shifted(((i / 4 - 0.5) * x, 0.1, 0)))
    for k in range(1, rng.randint(1, 5)):
        bars.append(box(x, 0.04, edge * 0.6).shifted((0, 0.1, k * z / 5)))
    return joined(bars)


def _dress(
    stage: Stage,
    side: Side,
    at: tuple[float, float, float],
    x: float,
    z: float,
    how: float,
) -> None:
    if how < 0.3:
        props.blinds(stage, at, side.turn, x, z)
    elif how < 0.65:
        for way in (-1, 1):
            c, s = math.cos(side.turn), math.sin(side.turn)
            off = way * (x / 2)
            spot = (at[0] + c * off + s * 0.12, at[1] + s * off - c * 0.12, 0.05)
            props.curtain(stage, spot, side.turn, x * 0.4, at[2] + z + 0.1)
    elif how < 0.75:
        stage.put(
            sheet(x, z).rotated("x", math.pi / 2).shifted((0, 0.1, z / 2)),
            stage.paint.pane(),
            at,
            side.turn,
        )


def _furnish(stage: Stage, room: Room) -> None:
    rng = stage.rng
    for _ in range(rng.randint(1, 3)):
        at = room.spot(stage, 1.0)
        size = (rng.uniform(0.6, 2.0), rng.uniform(0.5, 1.0), rng.uniform(0.4, 0.8))
        props.table(stage, at, turned(rng), *size)
    if stage.chance(0.3):
        _classroom(stage, room)
    _seats(stage, room)
    for side in room.sides():
        if stage.chance(0.45):
            props.shelf(
                stage,
                side.at(rng.uniform(0.7, side.length - 0.7), 0, 0.02),
                side.turn,
                rng.uniform(0.6, 1.6),
                rng.uniform(0.8, 2.1),
            )
    if stage.chance(0.35):
        props.stairs(
            stage,
            room.spot(stage, 1.2),
            turned(rng),
            rng.randint(5, 12),
            rng.uniform(0.8, 1.2),
        )
    for _ in range(rng.randint(2, 10)):
        props.small_thing(stage, room.spot(stage), rng.uniform(0.1, 0.8), 0.4)
    if stage.chance(0.4):
        stage.put(
            box(rng.uniform(1, 3), rng.uniform(1, 2.5), 0.012),
            stage.paint.cloth(),
            room.spot(stage, 1.2),
            turned(rng),
        )
    if stage.chance(0.5):
        props.plant(stage, room.spot(stage), rng.uniform(0.5, 1.6))


def _seats(stage: Stage, room: Room) -> None:
    seat, frame = stage.paint.any(0.5), stage.paint.any(0.3)
    for _ in range(stage.rng.randint(2, 7)):
        props.chair(stage, room.spot(stage), turned(stage.rng), seat, frame)
    for _ in range(stage.rng.randint(0, 3)):
        stage.model(
            stage.rng.uniform(0.7, 1.8),
            room.spot(stage, 0.8),
            turned(stage.rng),
            (
                "sofa",
                "Sofa",
                "Chair",
                "cabinet",
                "table",
                "stool",
                "bookshelf",
                "bed",
                "Lamp",
                "chest",
                "barrel",
                "keg",
                "library",
            ),
        )


def _classroom(stage: Stage, room: Room) -> None:
    """Rows of equal desks and chairs."""
    seat, frame = stage.paint.any(0.5), stage.paint.metal(0.3)
    y = -room.y / 2 + 0.8
    while y < room.y / 2 - 1.0:
        x = -room.x / 2 + 0.7
        while x < room.x / 2 - 0.5:
            stage.put(props.legs(0.7, 0.45, 0.7, 0.03, True), frame, (x, y, 0))
            stage.put(box(0.7, 0.5, 0.02), seat, (x, y, 0.7), 0.0, 0.004)
            props.chair(stage, (x, y + 0.5, 0), stage.rng.gauss(0, 0.2), seat, frame)
            x += 1.1
        y += 1.4


def _decorate(stage: Stage, room: Room) -> None:
    rng = stage.rng
    for side in room.sides():
        for _ in range(rng.randint(0, 4)):
            x, z = rng.uniform(0.2, 1.0), rng.uniform(0.2, 0.8)
            spot = side.at(rng.uniform(0.6, side.length - 0.6), rng.uniform(1.0, 1.6))
            kind = props.picture if stage.chance(0.75) else props.plaque
            kind(stage, spot, side.turn, x, z)
    if stage.chance(0.25):
        beams = [
            rod((x, -room.y / 2, room.z - 0.1), (x, room.y / 2, room.z - 0.1), 0.06)
            for x in (-room.x / 4, 0, room.x / 4)
        ]
        stage.put(joined(beams), stage.paint.wood())


def _light(stage: Stage, room: Room) -> None:
    rng, day = stage.rng, stage.chance(0.75)
    if day:
        lighting.sky(stage, rng.uniform(1.0, 4.0))
        if stage.chance(0.6):
            lighting.sun(stage, 6.0)
    else:
        stage.even_world((0.3, 0.4, 0.8), 0.05)
    volume = room.x * room.y
    for _ in range(rng.randint(0 if day else 2, 3)):
        kind = rng.random()
        at = room.spot(stage, 0.6)
        top = (at[0], at[1], room.z - 0.02)
        if kind < 0.3:
            lighting.pendant(
                stage, top, rng.uniform(0.4, 1.0), volume * rng.uniform(1, 4)
            )
        elif kind < 0.55:
            lighting.floor_lamp(
                stage, at, rng.uniform(0.5, 1.6), volume * rng.uniform(0.5, 2)
            )
        elif kind < 0.75:
            lighting.tube_light(stage, top, 1.2, turned(rng))
        else:
            lighting.area(
                stage,
                top,
                (at[0], at[1], 0),
                0.6,
                volume * rng.uniform(2, 6),
                (1, 1, 1),
            )
    # A weak fill keeps corners from being pure noise.
    lighting.area(
        stage,
        (0, 0, room.z - 0.03),
        (0, 0, 0),
        min(room.x, room.y) * 0.8,
        volume * rng.uniform(0.3, 3),
        props.tone(stage),
    )


def _views(stage: Stage, room: Room) -> None:
    rng = stage.rng
    for _ in range(6):
        x, y = room.x / 2 - 0.3, room.y / 2 - 0.3
        corner = (
            rng.choice((-1, 1)) * x * rng.uniform(0.4, 1),
            rng.choice((-1, 1)) * y * rng.uniform(0.4, 1),
            rng.uniform(0.5, 1.8),
        )
        there = (
            -corner[0] * rng.uniform(-0.3, 0.9),
            -corner[1] * rng.uniform(0, 0.9),
            rng.uniform(0.3, 1.5),
        )
        stage.look(corner, there, rng.choice((20, 24, 28, 35, 50)))
