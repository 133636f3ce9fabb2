"""Buttons: Render with XRDS, whatever the scene's engine, and a test of the path."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

from xrds_core.errors import SceneError, XRDSError
from xrds_core.version import package_version

from ..internals import engine_override
from ..rendering import torch_folder


class XRDS_OT_render(bpy.types.Operator):
    """Render this scene with XRDS; the scene keeps its render engine"""

    bl_idname = "xrds.render"
    bl_label = "Render with XRDS"

    animation: bpy.props.BoolProperty(
        name="Animation", description="Render the frame range", default=False
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.camera is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._render(context, "EXEC_DEFAULT")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self._render(context, "INVOKE_DEFAULT")

    def _render(self, context: bpy.types.Context, how: str) -> set[str]:
        running = False
        try:
            engine_override.begin(context.scene)
            done = bpy.ops.render.render(how, animation=self.animation)
            running = "RUNNING_MODAL" in done
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except RuntimeError as error:  # Blender's own message, shown as it shows them
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        finally:
            if not running:
                engine_override.withdraw()
        return {"FINISHED"}


def menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw the entries of the Render menu."""
    self.layout.separator()
    draw(self.layout)


def draw(layout: bpy.types.UILayout) -> None:
    """Draw a button for a still, and one for the animation."""
    layout.operator(XRDS_OT_render.bl_idname, icon="RENDER_STILL")
    animation = layout.operator(
        XRDS_OT_render.bl_idname,
        text="Render Animation with XRDS",
        icon="RENDER_ANIMATION",
    )
    animation.animation = True


def register() -> None:
    """Register the operator and its menu entries."""
    bpy.utils.register_class(XRDS_OT_render)
    bpy.types.TOPBAR_MT_render.append(menu)


def unregister() -> None:
    """Take them back."""
    bpy.types.TOPBAR_MT_render.remove(menu)
    bpy.utils.unregister_class(XRDS_OT_render)


SIDE, SAMPLES = 64, 4


class XRDS_OT_self_test(bpy.types.Operator):
    """Render a small picture with every part of XRDS and show what it ran on"""

    bl_idname = "xrds.self_test"
    bl_label = "Test XRDS"

    lines: list[str] = []
    """What the last test found, line by line; the preferences show it."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            lines = self_test()
        except XRDSError as error:
            self.lines[:] = [f"Failed: {error}"]
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.lines[:] = lines
        self.report({"INFO"}, "; ".join(lines))
        return {"FINISHED"}


def self_test() -> list[str]:
    """Render, check the picture, and return device, seconds and versions by line.

    Raises XRDSError where no picture, or a wrong one, comes out.
    """
    from ..rendering.render import render
    from .preference_values import preference_values

    here = preference_values()
    with _scene() as scene:
        picture = render(
            scene,
            2 if torch_folder.is_there() else 1,
            samples=SAMPLES,
            device=here.device,
            memory_limit=here.memory_limit,
            weights=here.weights,
            threads=here.threads,
        )
    _check(picture.radiance)
    return _lines(picture)


def _check(radiance: Any) -> None:
    if radiance.shape != (SIDE, SIDE, 3) or not np.isfinite(radiance).all():
        raise XRDSError("the test picture is damaged; try another device")
    if radiance.std() < 1e-3:
        raise XRDSError("the test picture is empty; try another device")


def _lines(picture: Any) -> list[str]:
    torch = "no PyTorch: full size alone"
    if torch_folder.is_there():
        torch = f"PyTorch {torch_folder.available().version}"
    parts = ", ".join(f"{k} {v:.2f}" for k, v in picture.seconds.items() if v)
    return [
        f"XRDS works: {SIDE} x {SIDE} pixels on {picture.device}",
        f"Seconds: {parts}",
        f"XRDS {package_version()}, Blender {bpy.app.version_string}, "
        f"Python {platform.python_version()}, {torch}",
    ]


@contextmanager
def _scene() -> Iterator[Any]:
    """A checkered ball over a floor, under a lamp; gone on exit."""
    items: list[tuple[Any, Any]] = []

    def new(kind: str, *words: Any) -> Any:
        collection = getattr(bpy.data, kind)
        item = collection.new("XRDS Test", *words)
        items.append((collection, item))
        return item

    try:
        yield _build(new)
    finally:
        for collection, item in reversed(items):
            collection.remove(item)


def _build(new: Any) -> Any:
    scene = new("scenes")
    render = scene.render
    render.resolution_x = render.resolution_y = SIDE
    render.resolution_percentage = 100
    scene.cycles.device = "CPU"
    mesh = new("meshes")
    corners = [(-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1)]
    top = [(-1, 0, -1), (1, 0, -1), (0, 0, 1)]
    mesh.from_pydata(corners + top, [], [(0, 1, 2, 3), (4, 5, 6)])
    scene.collection.objects.link(new("objects", mesh))
    lamp = new("objects", new("lights", "POINT"))
    lamp.data.energy, lamp.location = 500.0, (3, -4, 4)
    camera = scene.camera = new("objects", new("cameras"))
    camera.location, camera.rotation_euler = (0, -6, 1), (1.4, 0, 0)
    for item in (lamp, camera):
        scene.collection.objects.link(item)
    return scene
