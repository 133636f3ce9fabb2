"""Procedural materials of the demo scene: fine colour, bump, glass and metal."""

from __future__ import annotations

import bpy

from ..studio.nodes import Colour, Surface, Value, solid

WHITE = (1.0, 1.0, 1.0)


class Solid(Surface):
    """A material's nodes in object coordinates."""

    def where(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Value:
        """Object coordinates in metres, scaled along each axis."""
        place = self.add("TexCoord").outputs["Object"]
        return self.add("Mapping", Vector=place, Scale=(x, y, z)).outputs[0]

    def noise(self, at: Value, scale: float = 1.0, detail: float = 2.0) -> Value:
        """Noise about 0.5; details are at `1 / scale` metres and below."""
        return self.add("TexNoise", Vector=at, Scale=scale, Detail=detail).outputs[0]

    def cells(self, scale: float) -> Value:
        """Distance to the next of `scale` points per metre, in parts of that."""
        return self.add("TexVoronoi", Vector=self.where(), Scale=scale).outputs[0]

    def colours(self, factor: Value, *stops: tuple[float, Colour]) -> Value:
        """Map a factor to colours."""
        return self.ramp(factor, stops, "LINEAR")

    def times(self, a: Value, b: Value) -> Value:
        """Multiply two colours."""
        return self.mix(a, b, 1.0, "MULTIPLY")


def planks() -> bpy.types.Material:
    """Boards of oiled oak, the grain along x."""
    wood = Solid("Planks", Roughness=0.38)
    boards = wood.add(
        "TexBrick",
        Vector=wood.where(),
        Color1=(0.62, 0.62, 0.62),
        Color2=WHITE,
        Mortar=(0.03, 0.03, 0.03),
        Scale=1.0,
        Mortar_Size=0.0016,
        Brick_Width=1.3,
        Row_Height=0.145,
    )
    warp = wood.noise(wood.where(1.2, 9.0, 9.0), detail=3.0)
    grain = wood.noise(wood.where(6.0, 110.0, 110.0), 1.5, 8.0)
    rings = wood.math("FRACT", wood.math("MULTIPLY", warp, 9.0))
    tone = wood.math("ADD", wood.math("MULTIPLY", rings, 0.45), grain)
    stain = wood.colours(
        wood.math("MULTIPLY", tone, 0.8),
        (0.25, (0.09, 0.032, 0.012)),
        (0.5, (0.27, 0.115, 0.042)),
        (0.85, (0.46, 0.235, 0.095)),
    )
    wood.set(Base_Color=wood.times(stain, boards.outputs["Color"]))
    joints = wood.math("MULTIPLY", boards.outputs["Fac"], -4.0)
    wood.bump(wood.math("ADD", joints, grain), 0.0012)
    return wood.material


def tiles() -> bpy.types.Material:
    """Glazed wall tiles of 10 cm in the plane y = 0, a painted sun in each."""
    tile = Solid("Tiles", Roughness=0.12, Coat_Weight=0.4, Coat_Roughness=0.05)
    place = tile.add("SeparateXYZ", Vector=tile.where(10.0, 10.0, 10.0)).outputs
    centred = (
        tile.math("SUBTRACT", tile.math("FRACT", place[axis]), 0.5) for axis in "XZ"
    )
    u, v = (tile.math("ABSOLUTE", value) for value in centred)
    squares = (tile.math("MULTIPLY", value, value) for value in (u, v))
    radius = tile.math("SQRT", tile.math("ADD", *squares))
    wave = tile.math("SINE", tile.math("MULTIPLY", radius, 46.0))
    star = tile.math("SQRT", tile.math("MULTIPLY", u, v))
    paint = tile.colours(
        tile.math("ADD", tile.math("MULTIPLY", wave, 0.11), star),
        (0.0, (0.06, 0.115, 0.23)),
        (0.17, (0.06, 0.115, 0.23)),
        (0.2, (0.78, 0.75, 0.67)),
        (0.36, (0.78, 0.75, 0.67)),
        (0.38, (0.5, 0.21, 0.09)),
    )
    edge = tile.math("MAXIMUM", u, v)
    joint = tile.math("GREATER_THAN", edge, 0.478)
    cover = tile.colours(joint, (0.0, WHITE), (1.0, (0.34, 0.32, 0.29)))
    tile.set(Base_Color=tile.times(paint, cover))
    slope = tile.math("MULTIPLY", tile.math("POWER", edge, 9.0), -600.0)
    uneven = tile.math("MULTIPLY", tile.noise(tile.where(), 22.0), 0.35)
    tile.bump(tile.math("ADD", slope, uneven), 0.003)
    return tile.material


def linen(pale: Colour, dark: Colour, pitch: float = 0.03) -> bpy.types.Material:
    """Checked cloth, its threads some 2 mm apart; checks `pitch` metres wide."""
    cloth = Solid("Linen", Roughness=0.9, Sheen_Weight=0.3)
    checks = cloth.add(
        "TexChecker",
        Vector=cloth.where(),
        Color1=pale,
        Color2=dark,
        Scale=1.0 / pitch,
    )
    threads = (
        cloth.add(
            "TexWave",
            bands_direction=axis,
            Vector=cloth.where(),
            Scale=110.0,
            Distortion=0.6,
        ).outputs["Fac"]
        for axis in "XY"
    )
    weave = cloth.math("MULTIPLY", *threads)
    shade = cloth.colours(weave, (0.0, (0.45, 0.45, 0.45)), (0.6, WHITE))
    cloth.set(Base_Color=cloth.times(checks.outputs["Color"], shade))
    cloth.bump(weave, 0.0008)
    return cloth.material


def glass(tint: Colour = WHITE) -> bpy.types.Material:
    """Clear glass."""
    return solid(
        "Glass", Base_Color=tint, Roughness=0.0, IOR=1.47, Transmission_Weight=1.0
    )


def metal(
    colour: Colour, roughness: float, hammered: bool = False
) -> bpy.types.Material:
    """Bare metal with turning marks, or beaten by a hammer."""
    bare = Solid("Metal", Base_Color=colour, Metallic=1.0, Roughness=roughness)
    if hammered:
        bare.bump(bare.cells(75.0), 0.004, 0.6)
    else:
        bare.bump(bare.noise(bare.where(4.0, 4.0, 700.0)), 0.0004, 0.7)
    return bare.material


def stoneware() -> bpy.types.Material:
    """Glazed stoneware: cream, iron speckles, a blue band below the rim."""
    clay = Solid("Stoneware", Roughness=0.22, Coat_Weight=0.5, Coat_Roughness=0.08)
    iron = (0.16, 0.09, 0.05)
    speckles = clay.colours(clay.cells(230.0), (0.14, iron), (0.22, WHITE))
    level = clay.add("SeparateXYZ", Vector=clay.where()).outputs["Z"]
    wobble = clay.math("MULTIPLY", clay.noise(clay.where(), 30.0), 0.01)
    cream, blue = (0.74, 0.66, 0.53), (0.07, 0.17, 0.26)
    glaze = clay.colours(
        clay.math("MULTIPLY", clay.math("ADD", level, wobble), 8.0),
        (0.4, cream),
        (0.43, blue),
        (0.58, (0.1, 0.24, 0.33)),
        (0.61, cream),
    )
    clay.set(Base_Color=clay.times(glaze, speckles))
    clay.bump(clay.noise(clay.where(3.0, 3.0, 160.0)), 0.0015)
    return clay.material


def peel(colour: Colour, shade: Colour) -> bpy.types.Material:
    """Citrus peel: pores and a slow change of colour."""
    skin = Solid("Peel", Roughness=0.42)
    blush = skin.noise(skin.where(), 14.0, 4.0)
    skin.set(Base_Color=skin.colours(blush, (0.35, shade), (0.65, colour)))
    skin.bump(skin.cells(260.0), 0.0014)
    return skin.material


def pages() -> bpy.types.Material:
    """Pages of a closed book, seen from the side."""
    paper = Solid("Pages", Roughness=0.8)
    lines = paper.noise(paper.where(2.0, 2.0, 900.0))
    dark, pale = (0.42, 0.36, 0.27), (0.86, 0.8, 0.68)
    paper.set(Base_Color=paper.colours(lines, (0.35, dark), (0.6, pale)))
    return paper.material


def plain(name: str, colour: Colour, roughness: float = 0.6) -> bpy.types.Material:
    """One colour."""
    return solid(name, Base_Color=colour, Roughness=roughness)


def plaster() -> bpy.types.Material:
    """Limewashed wall, rough to the touch."""
    wall = Solid("Plaster", Roughness=0.95)
    clouds = wall.noise(wall.where(), 5.0, 9.0)
    dark, pale = (0.47, 0.39, 0.29), (0.7, 0.62, 0.5)
    wall.set(Base_Color=wall.colours(clouds, (0.3, dark), (0.7, pale)))
    wall.bump(wall.noise(wall.where(), 90.0, 8.0), 0.006)
    return wall.material
