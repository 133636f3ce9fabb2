"""Materials from the picture textures of a library."""

from __future__ import annotations

import random
from pathlib import Path

from . import patterns
from .assets import Library, load_image, texture_map
from .nodes import Surface, Value

MAPS = ("albedo", "roughness", "metallic", "opacity", "normal", "displacement")


def cover(
    surface: Surface, rng: random.Random, library: Library, folder: Path, density: float
) -> None:
    """Give a surface all maps of a texture set, `density` times per metre."""
    at = patterns.placed(surface, rng, density)
    maps = {kind: _map(surface, library, folder, kind, at) for kind in MAPS}
    base = maps["albedo"]
    if rng.random() < 0.4:
        tint = patterns.colour(rng, 0.3, 1.0)
        base = surface.mix(base, tint, rng.uniform(0.2, 1.0), "MULTIPLY")
    rough = maps["roughness"]
    surface.set(
        Base_Color=base,
        Roughness=rng.uniform(0.2, 0.9) if rough is None else rough,
        Metallic=maps["metallic"],
        Alpha=maps["opacity"],
        Coat_Weight=rng.choice((0.0, 0.0, 0.0, 0.7)),
    )
    if maps["normal"] is not None:
        surface.set(Normal=surface.add("NormalMap", Color=maps["normal"]).outputs[0])
    elif maps["displacement"] is not None:
        surface.bump(maps["displacement"], 0.03 / density, rng.uniform(0.2, 1.0))


def _map(
    surface: Surface, library: Library, folder: Path, kind: str, at: Value
) -> Value | None:
    path = texture_map(folder, kind)
    if path is None:
        return None
    library.note(path)
    image = load_image(path, colour=kind == "albedo")
    return surface.add("TexImage", image=image, Vector=at).outputs["Color"]
