"""Random procedural patterns and colours for materials."""

from __future__ import annotations

import colorsys
import random

from .nodes import Colour, Nodes, Value


def colour(rng: random.Random, dark: float = 0.03, light: float = 0.85) -> Colour:
    """A random reflectance, rather seldom saturated."""
    hue, value = rng.random(), rng.uniform(dark**0.5, light**0.5) ** 2
    return colorsys.hsv_to_rgb(hue, rng.betavariate(1.2, 2.0), value)


def wood_colour(rng: random.Random) -> Colour:
    """A brown between ebony and birch."""
    value = rng.uniform(0.04, 0.6)
    return colorsys.hsv_to_rgb(rng.uniform(0.03, 0.1), rng.uniform(0.35, 0.8), value)


def shade(rng: random.Random, base: Colour, spread: float = 0.5) -> Colour:
    """A colour near `base`, lighter or darker by up to about `spread`."""
    factor = 1 + rng.uniform(-spread, spread)
    return tuple(min(0.9, max(0.01, c * factor + rng.gauss(0, 0.02))) for c in base)


def placed(
    nodes: Nodes, rng: random.Random, density: float, stretch: float = 1.0
) -> Value:
    """Surface coordinates with `density` units per metre, at a random place."""
    source = nodes.add("TexCoord").outputs["UV"]
    return nodes.add(
        "Mapping",
        Vector=source,
        Location=(rng.uniform(0, 9), rng.uniform(0, 9), rng.uniform(0, 9)),
        Rotation=(0, 0, rng.choice((0, 0, 0, 1.5708, rng.uniform(0, 3)))),
        Scale=(density, density * stretch, density),
    ).outputs[0]


def noise(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Fractal noise of a random kind."""
    kind = rng.choice(("FBM", "FBM", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL"))
    node = nodes.add(
        "TexNoise",
        noise_type=kind,
        Vector=at,
        Scale=1.0,
        Detail=rng.choice((0.0, 1.0, 2.0, 3.0)),
        Roughness=rng.uniform(0.3, 0.75),
        Distortion=rng.choice((0.0, 0.0, rng.uniform(0, 3))),
    )
    return node.outputs[0]


def voronoi(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Cells, their distances or their edges."""
    feature = rng.choice(("F1", "F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"))
    node = nodes.add("TexVoronoi", feature=feature, Vector=at, Scale=1.0)
    node.inputs["Randomness"].default_value = rng.choice((1.0, 1.0, rng.random(), 0.0))
    if feature == "DISTANCE_TO_EDGE":
        return nodes.math("MULTIPLY", node.outputs["Distance"], rng.uniform(2, 12))
    return rng.choice((node.outputs["Distance"], node.outputs["Color"]))


def brick(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Bricks with dark mortar."""
    node = nodes.add(
        "TexBrick",
        offset=rng.choice((0.5, 0.5, 0.0, 0.33)),
        Vector=at,
        Scale=1.0,
        Color1=(0.3, 0.3, 0.3),
        Color2=(0.9, 0.9, 0.9),
        Mortar=(0.0, 0.0, 0.0),
        Mortar_Size=rng.uniform(0.005, 0.06),
        Mortar_Smooth=rng.random() * 0.3,
        Brick_Width=rng.uniform(0.5, 2.0),
        Row_Height=rng.uniform(0.2, 1.0),
    )
    return nodes.math("MULTIPLY", node.outputs["Color"], 1.0)


def checker(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Squares."""
    return nodes.add("TexChecker", Vector=at, Scale=2.0).outputs["Fac"]


def wave(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Bands or rings."""
    return nodes.add(
        "TexWave",
        wave_type=rng.choice(("BANDS", "BANDS", "RINGS")),
        wave_profile=rng.choice(("SIN", "SAW", "TRI")),
        Vector=at,
        Scale=rng.uniform(0.5, 2),
        Distortion=rng.choice((0.0, rng.uniform(0, 8))),
        Detail=rng.choice((0.0, 2.0)),
    ).outputs["Fac"]


def magic(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Swirls."""
    node = nodes.add(
        "TexMagic", turbulence_depth=rng.randint(1, 5), Vector=at, Scale=1.5
    )
    node.inputs["Distortion"].default_value = rng.uniform(0.5, 3)
    return node.outputs["Fac"]


def weave(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """Two crossed waves."""
    parts = [
        nodes.add("TexWave", bands_direction=way, Vector=at, Scale=1.0).outputs["Fac"]
        for way in "XY"
    ]
    return nodes.math(rng.choice(("MULTIPLY", "MAXIMUM", "MINIMUM")), *parts)


_KINDS = (noise, noise, voronoi, voronoi, brick, checker, wave, magic, weave)


def pattern(nodes: Nodes, rng: random.Random, at: Value) -> Value:
    """A random texture of the coordinates `at`: one value in about 0..1."""
    first = rng.choice(_KINDS)(nodes, rng, at)
    if rng.random() < 0.6:
        return first
    second = rng.choice(_KINDS)(nodes, rng, placed(nodes, rng, rng.uniform(2, 40)))
    mode = rng.choice(("MULTIPLY", "MAXIMUM", "MINIMUM", "ADD"))
    return nodes.math(mode, first, nodes.span(second, 0.2, 1.0))


def grain(nodes: Nodes, rng: random.Random, density: float) -> Value:
    """Wood grain: stretched noise, sometimes with rings."""
    at = placed(nodes, rng, density, rng.uniform(0.04, 0.15))
    fine = nodes.add("TexNoise", Vector=at, Scale=6.0, Detail=3.0, Roughness=0.7)
    if rng.random() < 0.5:
        return fine.outputs[0]
    rings = nodes.add(
        "TexWave", wave_type="RINGS", Vector=at, Scale=0.6, Distortion=4.0, Detail=3.0
    )
    return nodes.math("MULTIPLY", fine.outputs[0], rings.outputs["Fac"])


def tinted(
    nodes: Nodes, rng: random.Random, value: Value, base: Colour, varied: bool
) -> Value:
    """`value` through a random ramp of colours: around `base`, or any."""
    count = rng.choice((2, 2, 3, 4))
    stops = [
        (
            rng.uniform(i / count, (i + 1) / count),
            colour(rng) if varied else shade(rng, base),
        )
        for i in range(count)
    ]
    mode = rng.choice(("LINEAR", "LINEAR", "EASE", "CONSTANT"))
    return nodes.ramp(value, stops, mode)
