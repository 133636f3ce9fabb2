"""Render with XRDS from a button or the Render menu, whatever the scene's engine."""

from __future__ import annotations

import bpy

from xrds_core.errors import SceneError

from ..internals import engine_override


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
