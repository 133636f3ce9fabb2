"""Random Principled materials, with or without picture textures."""

from __future__ import annotations

import random
from collections.abc import Callable

import bpy

from . import patterns, textures
from .assets import Library, chosen
from .nodes import Surface, Value, solid


class Painter:
    """Makes materials; the choices come from `rng` and, if given, the library.

    `size` of a material is the length in metres over which it should show detail.
    """

    def __init__(self, rng: random.Random, library: Library | None) -> None:
        self.rng = rng
        self.library = library

    def any(self, size: float = 1.0) -> bpy.types.Material:
        """Any material that may cover a thing."""
        return self._pick(
            size,
            (self.patterned, 5),
            (self.pictured, 5),
            (self.painted, 3),
            (self.metal, 2),
            (self.coated, 2),
            (self.wood, 2),
            (self.cloth, 1.5),
            (self.wax, 0.7),
            (self.glass, 1.0),
            (self.glowing, 0.25),
        )

    def _pick(
        self, size: float, *kinds: tuple[Callable[[float], bpy.types.Material], float]
    ) -> bpy.types.Material:
        makers, weights = zip(*kinds, strict=True)
        return self.rng.choices(makers, weights)[0](size)

    def wall(self, size: float = 1.0) -> bpy.types.Material:
        """Wallpaper, paint, brick, panels or a picture texture."""
        return self._pick(
            size,
            (self.wallpaper, 4),
            (self.pictured, 3),
            (self.plaster, 3),
            (self.wood, 1),
        )

    def floor(self, size: float = 1.0) -> bpy.types.Material:
        """Boards, tiles, carpet or a picture texture."""
        return self._pick(
            size, (self.pictured, 5), (self.boards, 3), (self.tiles, 3), (self.cloth, 1)
        )

    def painted(self, size: float = 1.0) -> bpy.types.Material:
        """One colour, any roughness."""
        rng = self.rng
        return solid(
            "painted",
            Base_Color=patterns.colour(rng),
            Roughness=rng.uniform(0.05, 1.0),
            Specular_IOR_Level=rng.uniform(0.2, 0.8),
        )

    def plaster(self, size: float = 1.0) -> bpy.types.Material:
        """Light paint with fine unevenness."""
        rng = self.rng
        surface = Surface("plaster")
        light = rng.random() < 0.7
        base = patterns.colour(rng, 0.4 if light else 0.05, 0.9)
        surface.set(Base_Color=base, Roughness=rng.uniform(0.4, 0.95))
        at = patterns.placed(surface, rng, rng.uniform(5, 90))
        self._bump(surface, patterns.noise(surface, rng, at), 0.002)
        return surface.material

    def patterned(self, size: float = 1.0) -> bpy.types.Material:
        """A random pattern drives colour, often roughness and bump."""
        rng = self.rng
        surface = Surface("patterned")
        density = 2 ** rng.uniform(0, 5.5) / size
        stretch = rng.choice((1, 1, 1, rng.uniform(0.1, 4)))
        value = self._pattern(surface, density, stretch)
        base = patterns.tinted(
            surface, rng, value, patterns.colour(rng), rng.random() < 0.5
        )
        surface.set(Base_Color=base, Roughness=rng.uniform(0.1, 1.0))
        self._drive(surface, value, 0.3 / density)
        return surface.material

    def wallpaper(self, size: float = 1.0) -> bpy.types.Material:
        """A regular, fine, two or three coloured pattern."""
        rng = self.rng
        surface = Surface("wallpaper")
        at = patterns.placed(surface, rng, 2 ** rng.uniform(1.5, 5.0))
        makers = (
            patterns.magic,
            patterns.checker,
            patterns.wave,
            patterns.weave,
            patterns.voronoi,
            patterns.brick,
        )
        value = rng.choice(makers)(surface, rng, at)
        base = patterns.tinted(surface, rng, value, patterns.colour(rng, 0.15), False)
        surface.set(Base_Color=base, Roughness=rng.uniform(0.3, 0.9))
        return surface.material

    def wood(self, size: float = 1.0) -> bpy.types.Material:
        """Grained wood, raw or varnished."""
        rng = self.rng
        if self.library and rng.random() < 0.4:
            return self.pictured(size, ("wood", "Wood", "veneer", "Bark"))
        surface = Surface("wood")
        value = patterns.grain(surface, rng, 2 ** rng.uniform(2, 5) / max(size, 0.3))
        base = patterns.tinted(surface, rng, value, patterns.wood_colour(rng), False)
        coat = rng.choice((0.0, 0.0, 1.0))
        surface.set(
            Base_Color=base,
            Roughness=rng.uniform(0.2, 0.7),
            Coat_Weight=coat,
            Coat_Roughness=rng.uniform(0.01, 0.2),
        )
        self._drive(surface, value, 0.002)
        return surface.material

    def boards(self, size: float = 1.0) -> bpy.types.Material:
        """A floor of boards with grain and gaps."""
        rng = self.rng
        surface = Surface("boards")
        value = patterns.grain(surface, rng, rng.uniform(4, 14))
        base = patterns.tinted(surface, rng, value, patterns.wood_colour(rng), False)
        bricks = surface.add(
            "TexBrick",
            Vector=patterns.placed(surface, rng, 1.0),
            Scale=1.0,
            Color1=(1, 1, 1),
            Color2=(0.45, 0.45, 0.45),
            Mortar=(0.08, 0.08, 0.08),
            Mortar_Size=rng.uniform(0.002, 0.006),
            Brick_Width=rng.uniform(0.6, 2.0),
            Row_Height=rng.uniform(0.06, 0.2),
        )
        base = surface.mix(base, bricks.outputs["Color"], 1.0, "MULTIPLY")
        surface.set(Base_Color=base, Roughness=rng.uniform(0.1, 0.6))
        self._bump(surface, bricks.outputs["Color"], 0.003)
        return surface.material

    def tiles(self, size: float = 1.0) -> bpy.types.Material:
        """Glazed or stone tiles with joints."""
        rng = self.rng
        surface = Surface("tiles")
        edge = rng.uniform(0.05, 0.6)
        first = patterns.colour(rng, 0.1)
        bricks = surface.add(
            "TexBrick",
            offset=rng.choice((0.0, 0.5)),
            Scale=1.0,
            Vector=patterns.placed(surface, rng, 1.0),
            Color1=first,
            Color2=rng.choice((patterns.shade(rng, first, 0.2), patterns.colour(rng))),
            Mortar=patterns.colour(rng, 0.05, 0.5),
            Mortar_Size=edge * 0.015,
            Brick_Width=edge * rng.choice((1, 1, 2)),
            Row_Height=edge,
        )
        rough = surface.span(bricks.outputs["Fac"], rng.uniform(0.02, 0.3), 0.8)
        surface.set(Base_Color=bricks.outputs["Color"], Roughness=rough)
        self._bump(surface, surface.math("SUBTRACT", 1.0, bricks.outputs["Fac"]), 0.003)
        return surface.material

    def metal(self, size: float = 1.0) -> bpy.types.Material:
        """Steel, brass, copper or coloured metal; polished, brushed or patterned."""
        rng = self.rng
        surface = Surface("metal")
        base = rng.choice(
            (
                (0.9, 0.9, 0.9),
                (0.55, 0.55, 0.57),
                (0.9, 0.65, 0.3),
                (0.9, 0.5, 0.35),
                patterns.colour(rng, 0.3),
            )
        )
        rough: Value = rng.choice((0.02, rng.uniform(0.05, 0.5), rng.uniform(0.1, 0.4)))
        if rng.random() < 0.4:
            value = self._pattern(
                surface, 2 ** rng.uniform(1, 5) / size, rng.choice((1, 0.03, 20))
            )
            rough = surface.span(value, rng.uniform(0.02, 0.2), rng.uniform(0.2, 0.6))
        surface.set(
            Base_Color=base,
            Metallic=1.0,
            Roughness=rough,
            Anisotropic=rng.choice((0.0, 0.0, 0.7)),
        )
        return surface.material

    def coated(self, size: float = 1.0) -> bpy.types.Material:
        """Car paint, lacquer, porcelain: gloss over a colour, sometimes flakes."""
        rng = self.rng
        surface = Surface("coated")
        base: Value = patterns.colour(rng, 0.02, 0.7)
        if rng.random() < 0.4:
            cells = surface.add(
                "TexVoronoi", Vector=patterns.placed(surface, rng, 300), Scale=1.0
            )
            base = surface.mix(base, patterns.shade(rng, base), cells.outputs["Color"])
        elif rng.random() < 0.4:
            value = self._pattern(surface, 6 / size)
            base = patterns.tinted(surface, rng, value, base, True)
        surface.set(
            Base_Color=base,
            Metallic=rng.choice((0.0, 0.0, 0.8)),
            Roughness=rng.uniform(0.15, 0.6),
            Coat_Weight=1.0,
            Coat_Roughness=rng.choice((0.0, 0.02, 0.1)),
        )
        return surface.material

    def cloth(self, size: float = 1.0) -> bpy.types.Material:
        """Woven cloth with sheen."""
        rng = self.rng
        surface = Surface("cloth")
        at = patterns.placed(surface, rng, rng.uniform(30, 200))
        weave = patterns.weave(surface, rng, at)
        value = weave
        if rng.random() < 0.6:
            value = self._pattern(surface, rng.uniform(3, 30))
        base = patterns.tinted(
            surface, rng, value, patterns.colour(rng), rng.random() < 0.3
        )
        surface.set(Base_Color=base, Roughness=0.9, Sheen_Weight=rng.uniform(0, 1))
        self._bump(surface, weave, 0.002)
        return surface.material

    def wax(self, size: float = 1.0) -> bpy.types.Material:
        """Subsurface scattering."""
        rng = self.rng
        return solid(
            "wax",
            Base_Color=patterns.colour(rng, 0.3),
            Roughness=rng.uniform(0.2, 0.6),
            Subsurface_Weight=rng.uniform(0.4, 1),
            Subsurface_Scale=size * rng.uniform(0.02, 0.2),
        )

    def glass(self, size: float = 1.0) -> bpy.types.Material:
        """Clear or tinted, smooth or frosted glass."""
        rng = self.rng
        tint = rng.choice(((1.0, 1.0, 1.0), patterns.colour(rng, 0.6, 1.0)))
        return solid(
            "glass",
            Base_Color=tint,
            Transmission_Weight=1.0,
            IOR=rng.uniform(1.3, 1.7),
            Roughness=rng.choice((0.0, 0.0, rng.uniform(0.02, 0.3))),
        )

    def pane(self) -> bpy.types.Material:
        """Window glass: thin, does not shut out the sun."""
        return solid(
            "pane", Base_Color=(1, 1, 1), Roughness=0.0, Alpha=0.1, Metallic=1.0
        )

    def mirror(self) -> bpy.types.Material:
        """A clean mirror."""
        return solid("mirror", Base_Color=(0.95,) * 3, Metallic=1.0, Roughness=0.0)

    def glowing(
        self, size: float = 1.0, power: float | None = None
    ) -> bpy.types.Material:
        """A lit surface, plain or with a pattern."""
        rng = self.rng
        surface = Surface("glowing")
        base: Value = patterns.colour(rng, 0.4, 1.0)
        if rng.random() < 0.5:
            value = self._pattern(surface, 8 / size)
            base = patterns.tinted(surface, rng, value, base, True)
        strength = power if power is not None else 2 ** rng.uniform(0, 4)
        surface.set(Emission_Color=base, Emission_Strength=strength)
        surface.set(Base_Color=(0.1,) * 3)
        return surface.material

    def leaves(self, alpha: bool = False) -> bpy.types.Material:
        """Foliage, each island another green; `alpha` cuts it to ragged cards."""
        rng = self.rng
        surface = Surface("leaves")
        island = surface.add("NewGeometry").outputs["Random Per Island"]
        red, green = rng.uniform(0.02, 0.2), rng.uniform(0.08, 0.3)
        base = (red, green, rng.uniform(0.01, 0.08))
        base = patterns.tinted(surface, rng, island, base, False)
        surface.set(Base_Color=base, Roughness=rng.uniform(0.3, 0.8))
        if alpha:
            at = patterns.placed(surface, rng, rng.uniform(10, 60))
            holes = surface.math("GREATER_THAN", patterns.noise(surface, rng, at), 0.5)
            surface.set(Alpha=holes)
        return surface.material

    def varied(self) -> bpy.types.Material:
        """Each object and each island of it another colour: books, toys, tiles."""
        rng = self.rng
        surface = Surface("varied")
        island = surface.add("NewGeometry").outputs["Random Per Island"]
        thing = surface.add("ObjectInfo").outputs["Random"]
        value = surface.math("FRACT", surface.math("ADD", island, thing))
        stops = [(i / 8, patterns.colour(rng)) for i in range(8)]
        base = surface.ramp(value, stops, "CONSTANT")
        if rng.random() < 0.5:
            lines = self._pattern(surface, rng.uniform(20, 90))
            base = surface.mix(
                base, patterns.colour(rng), surface.math("GREATER_THAN", lines, 0.6)
            )
        surface.set(Base_Color=base, Roughness=rng.uniform(0.1, 0.9))
        return surface.material

    def pictured(
        self, size: float = 1.0, words: tuple[str, ...] = ()
    ) -> bpy.types.Material:
        """A texture set of the library (whose name has one of `words`)."""
        if self.library is None:
            return self.patterned(size)
        folder = chosen(self.rng, self.library.textures, words)
        surface = Surface(folder.name)
        density = 2 ** self.rng.uniform(-1, 1.5) / min(max(size, 0.1), 2.0)
        textures.cover(surface, self.rng, self.library, folder, density)
        return surface.material

    def _pattern(self, surface: Surface, density: float, stretch: float = 1) -> Value:
        """Any pattern, at a random place of the surface."""
        at = patterns.placed(surface, self.rng, density, stretch)
        return patterns.pattern(surface, self.rng, at)

    def _drive(self, surface: Surface, value: Value, depth: float) -> None:
        """Let a pattern change roughness and height as well, sometimes."""
        if self.rng.random() < 0.4:
            low, high = sorted(self.rng.uniform(0.05, 1.0) for _ in range(2))
            surface.set(Roughness=surface.span(value, low, high))
        if self.rng.random() < 0.5:
            self._bump(surface, value, depth)

    def _bump(self, surface: Surface, height: Value, depth: float) -> None:
        surface.bump(height, depth, self.rng.uniform(0.2, 1.0))
