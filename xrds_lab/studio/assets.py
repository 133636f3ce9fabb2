"""The folder of models, skies and textures that scenes may draw from."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

from xrds_core.errors import UsageError


@dataclass
class Library:
    """What an asset folder holds, in the order of names.

    `folder` has `models/*.glb`, `hdris/*.exr` and `textures/NAME/albedo.jpg`
    (and normal, roughness, displacement ... where a set has them).
    """

    models: tuple[Path, ...]
    skies: tuple[Path, ...]
    textures: tuple[Path, ...]
    used: list[str] = field(default_factory=list)

    @classmethod
    def at(cls, folder: str | Path) -> Library:
        """The library in `folder`; UsageError where there is nothing to use."""
        root = Path(folder)
        library = cls(
            tuple(sorted(root.glob("models/*.glb"))),
            tuple(sorted(root.glob("hdris/*.exr"))),
            tuple(sorted(path.parent for path in root.glob("textures/*/albedo.*"))),
        )
        if not (library.models and library.skies and library.textures):
            raise UsageError(
                f"no models/*.glb, hdris/*.exr and textures/*/albedo.* in {root}: "
                "give the folder that holds all three, or no assets at all"
            )
        return library

    def note(self, path: Path) -> None:
        """Remember that the scene uses `path`."""
        name = path.parent.name + "/" + path.name
        if name not in self.used:
            self.used.append(name)


def chosen(
    rng: random.Random, paths: Sequence[Path], words: Sequence[str] = ()
) -> Path:
    """One of the paths whose name has one of `words`; any if there is none."""
    named = [path for path in paths if any(word in path.name for word in words)]
    return rng.choice(named or paths)


def texture_map(folder: Path, kind: str) -> Path | None:
    """The file of one map (`albedo`, `normal` ...) of a texture set, if any."""
    return next(iter(sorted(folder.glob(kind + ".*"))), None)


def load_image(path: Path, colour: bool) -> bpy.types.Image:
    """The picture at `path` as colour or as plain numbers."""
    image = bpy.data.images.load(str(path), check_existing=True)
    if not colour:
        image.colorspace_settings.name = "Non-Color"
    return image


def import_model(path: Path, size: float) -> bpy.types.Object:
    """Import a GLB as one empty with children; stands on z = 0, longest side `size`.

    Raises RuntimeError where Blender cannot read the file.
    """
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(path))
    added = [thing for thing in bpy.data.objects if thing not in before]
    for thing in [thing for thing in added if thing.type in {"LIGHT", "CAMERA"}]:
        added.remove(thing)
        bpy.data.objects.remove(thing)
    bpy.context.view_layer.update()
    return _stood_on_floor(added, path.stem, size)


def _stood_on_floor(
    objects: list[bpy.types.Object], name: str, size: float
) -> bpy.types.Object:
    low, high = _bounds(objects)
    scale = size / max(*(high - low), 1e-6)
    foot = Vector(((low.x + high.x) / 2, (low.y + high.y) / 2, low.z))
    base = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(base)
    fit = Matrix.Scale(scale, 4) @ Matrix.Translation(-foot)
    for thing in objects:
        if thing.parent is None:
            thing.matrix_world = fit @ thing.matrix_world
            thing.parent = base
    return base


def _bounds(objects: list[bpy.types.Object]) -> tuple[Vector, Vector]:
    corners = [
        thing.matrix_world @ Vector(corner)
        for thing in objects
        if thing.type == "MESH"
        for corner in thing.bound_box
    ]
    low = Vector(min(corner[axis] for corner in corners) for axis in range(3))
    high = Vector(max(corner[axis] for corner in corners) for axis in range(3))
    return low, high


def copied(base: bpy.types.Object) -> bpy.types.Object:
    """A linked copy of an imported model: new objects, the same meshes."""
    twin = base.copy()
    bpy.context.scene.collection.objects.link(twin)
    for child in base.children:
        copy = copied(child)
        copy.parent = twin
        copy.matrix_parent_inverse = child.matrix_parent_inverse.copy()
    return twin
