"""What held-out scenes are built with: assets by name, and keyframes.

Lengths are metres, z is up. A shot has 48 frames; the file opens at the one that is
judged.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ..gallery.stage import uv
from ..studio.assets import copied, import_model, load_image, texture_map
from ..studio.builder import ORIGIN, Builder, aim, empty_scene
from ..studio.geometry import Point
from ..studio.nodes import Surface, Value

SIZE = (960, 540)
FIRST, JUDGED, LAST = 1, 24, 48
_SEED = 20


@dataclass
class Set(Builder):
    """A scene under construction, which takes models, skies and textures by name."""

    assets: Path
    rng: random.Random = field(default_factory=lambda: random.Random(_SEED))
    imported: dict[str, bpy.types.Object] = field(default_factory=dict)

    def model(
        self, name: str, size: float, at: Point = ORIGIN, turn: float = 0.0
    ) -> bpy.types.Object:
        """A model that stands at `at`, its longest side `size`, turned about z."""
        known = self.imported.get(name)
        if known is None:
            base = import_model(self.assets / f"models/{name}.glb", 1.0)
            self.imported[name] = base
        else:
            base = copied(known)
        base.location, base.rotation_euler = at, (0.0, 0.0, turn)
        base.scale = (size, size, size)
        return base

    def textured(
        self, name: str, density: float = 1.0, **principled: Value
    ) -> bpy.types.Material:
        """A material of a texture set, `density` times in a metre.

        `principled` are inputs of its shader, in place of the set's.
        """
        surface, folder = Surface(name, **principled), self.assets / "textures" / name
        at = uv(surface, density)
        for kind, wanted in (("albedo", "Base_Color"), ("roughness", "Roughness")):
            found = _image(surface, folder, kind, at)
            if found is not None and wanted not in principled:
                surface.set(**{wanted: found})
        bent = _image(surface, folder, "normal", at)
        if bent is not None:
            surface.set(Normal=surface.add("NormalMap", Color=bent).outputs[0])
        return surface.material

    def sky(self, name: str, strength: float = 1.0, turn: float = 0.0) -> None:
        """Light from a panorama, turned by radians about z."""
        nodes = self.world()
        image = load_image(self.assets / f"hdris/{name}.exr", colour=True)
        image.colorspace_settings.name = "Linear Rec.709"
        place = nodes.add("TexCoord").outputs["Generated"]
        way = nodes.add("Mapping", Vector=place, Rotation=(0.0, 0.0, turn))
        found = nodes.add("TexEnvironment", image=image, Vector=way.outputs[0])
        nodes.light(found.outputs["Color"], strength)

    def moves(
        self, start: tuple[Point, Point], end: tuple[Point, Point], lens: float
    ) -> bpy.types.Object:
        """A camera that goes from one (eye, target) to another within the shot."""
        camera = self.camera(*start, lens)
        camera.rotation_mode = "QUATERNION"
        for frame, (eye, target) in ((FIRST, start), (LAST, end)):
            look(camera, eye, target)
            camera.keyframe_insert("location", frame=frame)
            camera.keyframe_insert("rotation_quaternion", frame=frame)
        return camera


def _image(surface: Surface, folder: Path, kind: str, at: Value) -> Value | None:
    path = texture_map(folder, kind)
    if path is None:
        return None
    image = load_image(path, colour=kind == "albedo")
    return surface.add("TexImage", image=image, Vector=at).outputs["Color"]


def open_set(assets: Path) -> Set:
    """Open an empty file, set up for pictures that do not take long."""
    scene = empty_scene(*SIZE)
    cycles = scene.cycles
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 6, 2, 3
    cycles.transmission_bounces = cycles.transparent_max_bounces = 6
    cycles.use_light_tree = False  # of one or two lamps it only takes time
    scene.view_settings.view_transform = "Standard"
    scene.frame_start, scene.frame_end = FIRST, LAST
    return Set(scene, assets)


def keyed(owner: Any, path: str, values: Mapping[int, Any]) -> None:
    """Keyframe an attribute by frame, eased as Blender does."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def look(thing: bpy.types.Object, eye: Point, target: Point) -> None:
    """Place a thing whose rotation is a quaternion at `eye`, looking at `target`."""
    aim(thing, eye, target)
    thing.rotation_quaternion = thing.rotation_euler.to_quaternion()
