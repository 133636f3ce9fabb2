"""A .blend file, opened to be rendered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from xrds_core.errors import SceneError


def open_scene(path: Path, resolution: tuple[int, int] | None = None) -> Any:
    """Open a .blend file and return its scene, ready to render.

    Whatever Blender has open is replaced. `resolution`, width and height in pixels,
    takes the place of the file's.

    Raises SceneError if there is no such file, Blender cannot read it, or it has no
    camera.
    """
    import bpy

    if not path.is_file():
        raise SceneError(f"no file {path}")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error:").split())
        raise SceneError(f"Blender cannot open {path}: {reason}") from error
    scene = bpy.context.scene
    if scene.camera is None:
        raise SceneError(f"{path} has no camera in scene {scene.name!r}; add one")
    if resolution:
        scene.render.resolution_x, scene.render.resolution_y = resolution
        scene.render.resolution_percentage = 100
    return scene
