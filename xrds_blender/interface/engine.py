"""The render engine XRDS: what Blender calls, handed on to our path or to Cycles."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import bpy

from ..cycles import session
from ..internals.engine_override import ENGINE
from . import thread_guard
from .panel import messages


class XRDSRender(bpy.types.RenderEngine):
    """Cycles' samples, those of neighbouring frames as well, denoised or enlarged."""

    bl_idname = ENGINE
    bl_label = "XRDS"
    bl_use_preview = True
    bl_use_eevee_viewport = True
    bl_use_exclude_layers = True
    bl_use_spherical_stereo = True
    bl_use_custom_freestyle = True
    bl_use_alembic_procedural = True
    bl_use_shading_nodes_custom = False

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.session: Any = None
        self.most_samples = 0
        self.spare_passes: set[tuple[str, str]] = set()

    def __del__(self) -> None:
        # Blender may have taken its half of the object away already.
        with suppress(ReferenceError):
            session.free(self)

    # What renders is imported when Blender first asks for it: Blender starts faster.

    def update_render_passes(self, scene: Any, layer: Any) -> None:
        session.functions().register_passes(self, scene, layer)

    def update(self, data: Any, depsgraph: Any) -> None:
        # A final render makes its sessions itself, with their own sizes.
        if self.is_preview:
            cycles = session.functions()
            if not self.session:
                cycles.create(self, data)
            cycles.reset(self, data, depsgraph)

    def render(self, depsgraph: Any) -> None:
        if self.is_preview:
            session.functions().render(self, depsgraph)
        else:
            with thread_guard.shared():
                from ..rendering.blender_job import render_in

                render_in(self, depsgraph, lambda: self._render_requested(depsgraph))

    def _render_requested(self, depsgraph: Any) -> None:
        """Render what the scene's settings describe, and report what was done."""
        from ..cycles.settings import subset_of_file
        from ..rendering.picture import log_line, record_of, stamp_result
        from ..rendering.render import render_frame
        from .properties import request_of

        scene, request = depsgraph.scene_eval, request_of(depsgraph.scene_eval.xrds)
        # Cycles may free the scene as it renders.
        frame = scene.frame_current
        _, samples = subset_of_file(scene.cycles, scene.cycles.samples)
        layer, notes = depsgraph.view_layer_eval.name, list(messages.notes_of(scene))
        picture = render_frame(self, depsgraph, request)
        settings = picture.settings or request.settings
        entries = record_of(picture, settings, samples)
        stamp_result(self, entries, layer)
        line = log_line(entries, frame, layer)
        self.report({"INFO"}, line)
        if not bpy.app.background:  # a window shows one report of a whole animation
            print(line, flush=True)
        for note in notes if settings.is_enlarged else ():
            self.report({"INFO"}, f"XRDS: {note}")

    def render_frame_finish(self) -> None:
        if self.session:
            session.functions().render_frame_finish(self)

    def draw(self, context: Any, depsgraph: Any) -> None:
        from . import live_picture

        live_picture.draw(self, depsgraph, context.space_data)

    def bake(
        self,
        depsgraph: Any,
        item: Any,
        pass_type: str,
        pass_filter: int,
        width: int,
        height: int,
    ) -> None:
        cycles = session.functions()
        if not self.session:
            cycles.create(self, bpy.data)
            cycles.reset(self, bpy.data, depsgraph)
        cycles.bake(self, depsgraph, item, pass_type, pass_filter, width, height)

    def view_update(self, context: Any, depsgraph: Any) -> None:
        cycles = session.functions()
        if not self.session:
            place = context.region, context.space_data, context.region_data
            cycles.create(self, context.blend_data, *place)
        cycles.reset(self, context.blend_data, depsgraph)
        cycles.sync(self, depsgraph, context.blend_data)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        place = context.region, context.space_data, context.region_data
        session.functions().view_draw(self, depsgraph, *place)
