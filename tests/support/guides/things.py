"""Puts things on a grid before the camera, each with its image or attribute."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from xrds_lab.studio.builder import Builder
from xrds_lab.studio.geometry import box
from xrds_lab.studio.nodes import Surface

COLUMNS = 8
FILE_SIZE = 1000  # bytes of each image file, whatever it shows


class Stage(Builder):
    """Puts things on the grid, one after the other."""

    def __init__(self, scene: Any, folder: Path) -> None:
        super().__init__(scene)
        self.folder, self._count = folder, 0

    def place(self) -> tuple[float, float, float]:
        """The next free place of the grid."""
        column, row = self._count % COLUMNS, self._count // COLUMNS
        self._count += 1
        return (column - (COLUMNS - 1) / 2) * 1.2, 0.0, 2.8 - row * 1.2

    def thing(self, name: str, material: Any, shape: Any = None) -> Any:
        """A box, or another shape about as large, of one material."""
        shape = shape or box(0.9, 0.9, 0.9)
        return self.put(shape, material, self.place(), turn=0.3, name=name)

    def tinted(self, name: str, kind: str, attribute: str, shape: Any = None) -> Any:
        """A thing whose colour an Attribute node reads."""
        surface = Surface(name)
        node = surface.add("Attribute", attribute_type=kind, attribute_name=attribute)
        surface.set(Base_Color=node.outputs["Fac"])
        return self.thing(name, surface.material, shape)

    def empty(self, name: str, at: Any = (0.0, 0.0, 0.0)) -> Any:
        """An empty."""
        return self.link(name, None, at)

    def pictured(self, name: str, image: Any) -> Any:
        """A thing that shows an image."""
        surface = Surface(name)
        node = surface.add("TexImage", image=image)
        surface.set(Base_Color=node.outputs["Color"])
        return self.thing(name, surface.material)


def painted(name: str) -> Any:
    """An image of its own pixels."""
    image = bpy.data.images.new(name, 8, 8)
    image.pixels.foreach_set(np.linspace(0, 1, 256, dtype=np.float32))
    image.update()
    return image


def saved(path: Path) -> Any:
    """The same as a file."""
    image = painted(path.stem)
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
    path.write_bytes(path.read_bytes().ljust(FILE_SIZE, b"\0"))
    return bpy.data.images.load(str(path))
