"""Render with XRDS from a button or the Render menu, whatever the scene's engine."""

from __future__ import annotations

import bpy

from ..frame.job import ENGINE

LOOK_AGAIN = 0.25  # seconds between two looks at a running render job


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
        scene = context.scene
        engine, scene.render.engine = scene.render.engine, ENGINE
        running = False
        try:
            done = bpy.ops.render.render(how, animation=self.animation)
            running = "RUNNING_MODAL" in done
        except RuntimeError as error:  # Blender's own message, shown as it shows them
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        finally:
            if running:
                _give_back_later(scene.name, engine)
            else:
                scene.render.engine = engine
        return {"FINISHED"}


def _give_back_later(scene_name: str, engine: str) -> None:
    """Set the engine back once the render job is over, from the main thread."""

    def look() -> float | None:
        if bpy.app.is_job_running("RENDER"):
            return LOOK_AGAIN
        scene = bpy.data.scenes.get(scene_name)
        if scene is not None and scene.render.engine == ENGINE:
            scene.render.engine = engine
        return None

    bpy.app.timers.register(look, first_interval=LOOK_AGAIN)


def menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw the entries of the Render menu."""
    self.layout.separator()
    self.layout.operator(XRDS_OT_render.bl_idname, icon="RENDER_STILL")
    animation = self.layout.operator(
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
