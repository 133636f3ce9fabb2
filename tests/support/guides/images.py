"""Changes of what an image holds, in its file, in Blender, or in a render."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from tests.support.guides.things import FILE_SIZE


def _rewrite(path: Path, value: float) -> None:
    """Write a file anew, of another colour and as long as before."""
    image = bpy.data.images.load(str(path))
    image.pixels.foreach_set(np.full(len(image.pixels), value, np.float32))
    image.save()
    bpy.data.images.remove(image)
    path.write_bytes(path.read_bytes().ljust(FILE_SIZE, b"\0"))


def file_rewritten(folder: Path) -> None:
    """Other pixels in the same file."""
    _rewrite(folder / "filed.png", 0.8)


def file_of_equal_size_and_time(folder: Path) -> None:
    """Other pixels in a file of the same length and time."""
    path = folder / "filed.png"
    before = path.stat()
    _rewrite(path, 0.8)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size


def file_gone(folder: Path) -> None:
    """No file any more."""
    (folder / "filed.png").unlink()


def texel_painted(_: Path) -> None:
    """One texel of a painted image."""
    bpy.data.images["painted"].pixels[120] = 1.0


def texel_packed(_: Path) -> None:
    """One texel of a packed image, packed again."""
    image = bpy.data.images["packed.png"]
    image.pixels[60:64] = (1.0, 0.0, 0.0, 1.0)
    image.pack()


def sequence_file_rewritten(folder: Path) -> None:
    """The second file of a sequence, shown in frame 2; the first as before."""
    _rewrite(folder / "frame_0002.png", 0.95)


def viewer(_: Path) -> None:
    """A compositor with a viewer, whose image every render changes."""
    tree = _compositor()
    layers, shown = (
        tree.nodes.new(f"CompositorNode{kind}") for kind in ("RLayers", "Viewer")
    )
    tree.links.new(layers.outputs[0], shown.inputs[0])


def viewer_as_texture(folder: Path) -> None:
    """The viewer's image on a thing."""
    viewer(folder)
    image = next(each for each in bpy.data.images if each.source == "VIEWER")
    bpy.data.materials["Painted"].node_tree.nodes["Image Texture"].image = image


def _compositor() -> Any:
    scene = bpy.data.scenes["Scene"]
    if hasattr(scene, "compositing_node_group"):  # from Blender 5.0 on
        tree = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
        scene.compositing_node_group = tree
        return tree
    scene.use_nodes = True
    return scene.node_tree
