"""Things that stand in rooms and streets: furniture, railings, plants, clutter."""

from __future__ import annotations

import math

import bpy
import numpy as np

from . import patterns
from .geometry import (
    Point,
    Shape,
    Vertices,
    box,
    cone,
    cylinder,
    joined,
    lathe,
    lumpy,
    quads,
    rod,
    sheet,
    sphere,
    torus,
    tube,
)
from .stage import Stage, turned


def legs(x: float, y: float, height: float, thick: float, round_: bool) -> Shape:
    """Four legs under a rectangle."""
    leg = cylinder(thick / 2, height, 10) if round_ else box(thick, thick, height)
    i, j = x / 2 - thick, y / 2 - thick
    return joined([leg.shifted((a, b, 0)) for a in (-i, i) for b in (-j, j)])


def table(stage: Stage, at: Point, turn: float, x: float, y: float, z: float) -> None:
    """A table top on four legs, with small things on it."""
    rng = stage.rng
    top = stage.paint.wood(0.7) if stage.chance(0.6) else stage.paint.any(0.7)
    frame = top if stage.chance(0.5) else stage.paint.metal(0.3)
    stage.put(
        legs(x, y, z, rng.uniform(0.025, 0.08), stage.chance(0.5)), frame, at, turn
    )
    slab = box(x, y, 0.035).shifted((0, 0, z))
    stage.put(slab, top, at, turn, 0.005)
    for _ in range(rng.randint(1, 7)):
        u, v = rng.uniform(-0.4, 0.4) * x, rng.uniform(-0.4, 0.4) * y
        c, s = math.cos(turn), math.sin(turn)
        spot = (at[0] + c * u - s * v, at[1] + s * u + c * v, at[2] + z + 0.035)
        small_thing(stage, spot, rng.uniform(0.08, 0.3))


def chair(
    stage: Stage,
    at: Point,
    turn: float,
    seat: bpy.types.Material,
    frame: bpy.types.Material,
) -> None:
    """A chair with thin legs and a slatted or solid back, of two materials."""
    rng = stage.rng
    thick, high = rng.uniform(0.018, 0.045), rng.uniform(0.38, 0.5)
    stage.put(legs(0.42, 0.42, high, thick, stage.chance(0.5)), frame, at, turn)
    stage.put(box(0.44, 0.44, 0.03).shifted((0, 0, high)), seat, at, turn, 0.01)
    back = [box(thick, thick, 0.45).shifted((x, 0.2, high)) for x in (-0.2, 0.2)]
    count = rng.choice((1, 3, 5))
    for i in range(count):
        z = high + 0.1 + 0.35 * i / count
        back.append(box(0.4, 0.02, 0.25 / count).shifted((0, 0.2, z)))
    stage.put(joined(back), seat, at, turn)


def shelf(stage: Stage, at: Point, turn: float, x: float, z: float) -> None:
    """A bookcase full of books and small things; its back is at y = 0."""
    rng, depth = stage.rng, 0.3
    rows = rng.randint(3, 7)
    step = z / rows
    boards = [
        box(x, depth, 0.02).shifted((0, -depth / 2, i * step)) for i in range(rows + 1)
    ]
    sides = [box(0.02, depth, z).shifted((i, -depth / 2, 0)) for i in (-x / 2, x / 2)]
    stage.put(joined(boards + sides), stage.paint.wood(0.8), at, turn)
    books = [
        book.shifted((0, 0, i * step + 0.02))
        for i in range(rows)
        for book in _books(stage, x - 0.06, depth, step)
    ]
    if books:
        stage.put(joined(books), stage.paint.varied(), at, turn)


def _books(stage: Stage, length: float, depth: float, step: float) -> list[Shape]:
    rng, x, row = stage.rng, -length / 2, []
    while x < length / 2 - 0.06:
        thick = rng.uniform(0.012, 0.055)
        tall = step * rng.uniform(0.5, 0.88)
        if rng.random() < 0.88:
            deep = depth * rng.uniform(0.5, 0.85)
            row.append(
                box(thick * 0.94, deep, tall).shifted(
                    (x + thick / 2, -deep / 2 - 0.02, 0)
                )
            )
        x += thick
    return row


def vase(stage: Stage, at: Point, size: float) -> None:
    """A turned body: vase, bottle, bowl, skittle."""
    rng = stage.rng
    count = rng.randint(4, 8)
    knots = [size * rng.uniform(0.08, 0.38) for _ in range(count)]
    heights = np.linspace(0, size, 40)
    radius = np.interp(heights, np.linspace(0, size, count), knots)
    radius = np.convolve(np.pad(radius, 3, mode="edge"), np.ones(7) / 7, "valid")
    profile = [(0.0, 0.0), *zip(radius.tolist(), heights.tolist(), strict=True)]
    stage.put(lathe(profile, 48), stage.paint.any(size), at, turned(rng))


def blob(stage: Stage, at: Point, size: float) -> None:
    """A smooth lump."""
    body = sphere(size / 2, 64)
    body = lumpy(
        body,
        stage.dice,
        size * stage.rng.uniform(0.3, 1.2),
        stage.rng.uniform(0.1, 0.6),
    )
    stage.put(
        body,
        stage.paint.any(size),
        (at[0], at[1], at[2] + size * 0.45),
        turned(stage.rng),
    )


def ring(stage: Stage, at: Point, size: float) -> None:
    """A torus lying or standing."""
    thick = size * stage.rng.uniform(0.05, 0.2)
    shape = torus(size / 2 - thick, thick)
    lift = thick
    if stage.chance(0.5):
        shape, lift = shape.rotated("x", math.pi / 2), size / 2
    stage.put(
        shape, stage.paint.any(size), (at[0], at[1], at[2] + lift), turned(stage.rng)
    )


def block(stage: Stage, at: Point, size: float) -> None:
    """A box, plain or bevelled."""
    x, y, z = (size * stage.rng.uniform(0.2, 1) for _ in range(3))
    bevel = stage.rng.choice((0.0, 0.0, size * 0.03))
    stage.put(box(x, y, z), stage.paint.any(size), at, turned(stage.rng), bevel)


def ball(stage: Stage, at: Point, size: float) -> None:
    """A sphere."""
    stage.put(sphere(size / 2), stage.paint.any(size), (at[0], at[1], at[2] + size / 2))


def peg(stage: Stage, at: Point, size: float) -> None:
    """A cylinder or cone."""
    low = size * stage.rng.uniform(0.1, 0.5)
    shape = cone(
        low, low * stage.rng.choice((1, 1, 0.5, 0)), size, stage.rng.choice((6, 32))
    )
    stage.put(shape, stage.paint.any(size), at, turned(stage.rng))


def wire(stage: Stage, at: Point, size: float) -> None:
    """A bent thin wire."""
    t = np.linspace(0, 1, 60)[:, None]
    phase, pitch = stage.dice.uniform(0, 6, 3), stage.dice.uniform(3, 20, 3)
    path = np.sin(phase + pitch * t) * size / 2 + (0, 0, size / 2)
    shape = tube(path, size * stage.rng.uniform(0.005, 0.04))
    stage.put(shape, stage.paint.any(size), at)


def sign(stage: Stage, at: Point, size: float) -> None:
    """Standing letters."""
    letters = "".join(
        stage.rng.choice("ABCDEGHKMPRSTUWXYZ 0123456789") for _ in range(6)
    )
    material, turn = stage.paint.any(size), stage.rng.uniform(-1, 1)
    stage.write(letters, size * 0.5, material, at, turn, extrude=size * 0.03)


def stack(stage: Stage, at: Point, size: float) -> None:
    """A pile of thin boxes: books, plates, papers."""
    parts, z = [], 0.0
    while z < size * 0.8:
        thick = size * stage.rng.uniform(0.03, 0.12)
        shape = box(size * 0.8, size * 0.6, thick * 0.95)
        parts.append(shape.moved((0, 0, z), stage.rng.gauss(0, 0.15)))
        z += thick
    stage.put(joined(parts), stage.paint.varied(), at, turned(stage.rng))


_SMALL = (vase, vase, block, block, ball, peg, ring, blob, wire, stack, sign)


def small_thing(stage: Stage, at: Point, size: float, models: float = 0.25) -> None:
    """Any thing of about `size` standing at `at`."""
    if stage.library is not None and stage.chance(models):
        stage.model(size, at, turned(stage.rng))
    else:
        stage.rng.choice(_SMALL)(stage, at, size)


def picture(stage: Stage, at: Point, turn: float, x: float, z: float) -> None:
    """A framed picture (or mirror) on a wall that faces -y before the turn."""
    rng, edge = stage.rng, stage.rng.uniform(0.015, 0.08)
    bars = [box(x + 2 * edge, 0.04, edge).shifted((0, -0.02, b)) for b in (-edge, z)]
    bars += [
        box(edge, 0.04, z).shifted((b, -0.02, 0))
        for b in (-(x + edge) / 2, (x + edge) / 2)
    ]
    stage.put(joined(bars), stage.paint.any(0.4), at, turn)
    makers = (stage.paint.pictured, stage.paint.patterned, stage.paint.wallpaper)
    inside = (
        stage.paint.mirror() if stage.chance(0.15) else rng.choice(makers)(min(x, z))
    )
    stage.put(box(x, 0.01, z).shifted((0, -0.006, 0)), inside, at, turn)
    if stage.chance(0.3):
        stage.put(box(x, 0.003, z).shifted((0, -0.03, 0)), stage.paint.pane(), at, turn)


def curtain(stage: Stage, at: Point, turn: float, width: float, height: float) -> None:
    """Hanging cloth with folds."""
    waves, deep = stage.rng.uniform(4, 14) / width, stage.rng.uniform(0.02, 0.06)
    shape = sheet(width, height, 120, 6).rotated("x", math.pi / 2)

    def fold(vertices: Vertices) -> Vertices:
        out = vertices.copy()
        x, z = vertices[:, 0], vertices[:, 2]
        out[:, 1] += (
            deep * np.sin(waves * 6 * x + np.sin(2 * x + z)) * (0.7 + 0.3 * z / height)
        )
        return out

    shape = shape.bent(fold).shifted((0, 0, height / 2))
    stage.put(shape, stage.paint.cloth(1.0), at, turn)


def blinds(stage: Stage, at: Point, turn: float, width: float, height: float) -> None:
    """Venetian blinds hanging over an opening whose lower edge is at `at`."""
    pitch, tilt = stage.rng.uniform(0.02, 0.06), stage.rng.uniform(0.1, 1.2)
    low = stage.rng.uniform(0, 0.6) * height
    slat = box(width, pitch * 0.95, 0.0015).rotated("x", tilt)
    slats = [slat.shifted((0, 0, z)) for z in np.arange(low, height, pitch)]
    cords = [
        cylinder(0.002, height - low, 6).shifted((x * width, 0, low))
        for x in (-0.35, 0.35)
    ]
    stage.put(joined(slats + cords), stage.paint.painted(), at, turn)


def railing(stage: Stage, start: Point, end: Point, height: float) -> None:
    """A handrail on thin balusters between two points (any slope)."""
    rng = stage.rng
    a, b = np.asarray(start, float), np.asarray(end, float)
    count = max(2, int(np.linalg.norm(b - a) / rng.uniform(0.08, 0.3)))
    thin = rng.uniform(0.004, 0.02)
    feet = [a + (b - a) * i / count for i in range(count + 1)]
    up = np.array((0, 0, height))
    posts = [rod(foot, foot + up, thin) for foot in feet]
    rails = [
        rod(a + up * k, b + up * k, thin * 1.5)
        for k in rng.choice(((1,), (0.1, 1), (0.5, 1)))
    ]
    stage.put(joined(posts + rails), stage.paint.any(0.2))


def plant(stage: Stage, at: Point, size: float) -> None:
    """A crown of many small leaves on a stem."""
    count = stage.rng.randint(150, 1500)
    spots = stage.dice.normal((0, 0, size * 0.7), 0.22 * size, (count, 3))
    leaves = scattered(stage, spots, size * stage.rng.uniform(0.03, 0.1))
    alpha = stage.chance(0.15)
    stage.put(leaves, stage.paint.leaves(alpha), at)
    stage.put(cone(size * 0.03, size * 0.015, size * 0.7), stage.paint.wood(0.5), at)


def scattered(stage: Stage, spots: Vertices, size: float) -> Shape:
    """Kite-shaped leaves at the points (n, 3), in random directions."""
    dice, count = stage.dice, len(spots)
    along = dice.normal(size=(count, 3))
    across = np.cross(along, dice.normal(size=(count, 3)))
    length = size * dice.uniform(0.5, 1.5, (count, 1))
    along *= length / np.linalg.norm(along, axis=1, keepdims=True)
    across *= length * 0.3 / np.linalg.norm(across, axis=1, keepdims=True)
    mid = spots + along * 0.4
    return quads(np.stack([spots, mid + across, spots + along, mid - across], 1))


def grass(stage: Stage, centre: Point, reach: float, count: int) -> None:
    """Thin blades over a square of half side `reach`."""
    dice = stage.dice
    foot = np.zeros((count, 3))
    foot[:, :2] = dice.uniform(-reach, reach, (count, 2))
    tall = dice.uniform(0.05, 0.25, (count, 1)) * (0, 0, 1)
    lean = dice.normal(0, 0.06, (count, 3)) * (1, 1, 0)
    side = dice.normal(0, 1, (count, 3)) * (1, 1, 0)
    side *= 0.006 / np.linalg.norm(side, axis=1, keepdims=True)
    top = foot + tall + lean
    blades = quads(
        np.stack([foot - side, foot + side, top + side * 0.2, top - side * 0.2], 1)
    )
    stage.put(blades, stage.paint.leaves(), centre)


def stairs(stage: Stage, at: Point, turn: float, steps: int, width: float) -> None:
    """A straight flight of steps with a railing, climbing along +y before the turn."""
    rise, run = stage.rng.uniform(0.15, 0.19), stage.rng.uniform(0.24, 0.3)
    treads = [
        box(width, run + 0.03, 0.04).shifted((0, i * run, (i + 1) * rise - 0.04))
        for i in range(steps)
    ]
    risers = [
        box(width, 0.02, rise).shifted((0, i * run - run / 2, i * rise))
        for i in range(steps)
    ]
    stage.put(joined(treads), stage.paint.wood(1.0), at, turn, 0.006)
    stage.put(joined(risers), stage.paint.any(0.5), at, turn)
    c, s = math.cos(turn), math.sin(turn)
    for x in (-width / 2, width / 2):
        low = (at[0] + c * x, at[1] + s * x, at[2] + rise)
        high = (
            low[0] - s * steps * run,
            low[1] + c * steps * run,
            at[2] + steps * rise,
        )
        railing(stage, low, high, 0.9)


def plaque(stage: Stage, at: Point, turn: float, x: float, z: float) -> None:
    """A thin coloured board on a wall, glowing now and then."""
    lit = stage.chance(0.2)
    material = stage.paint.glowing(0.5) if lit else stage.paint.any(min(x, z))
    stage.put(box(x, 0.02, z).shifted((0, -0.01, 0)), material, at, turn)


def tone(stage: Stage) -> tuple[float, float, float]:
    """A random lamp colour, often near white."""
    colour = patterns.colour(stage.rng, 0.4, 1.0)
    peak = max(colour)
    return tuple(c / peak for c in colour)
