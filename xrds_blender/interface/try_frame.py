"""Try on This Frame: the current frame both ways, side by side in an Image Editor."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import bpy

from xrds_core.errors import Cancelled, XRDSError
from xrds_core.progress import duration

from ..planning.estimates import resolved
from ..planning.request import Request
from ..planning.settings import Mode
from ..rendering import history
from ..rendering.blender_job import Job
from ..rendering.try_frame import FEWEST, Way, work_of
from . import split
from .panel.paragraph import translated
from .properties import request_of

_LOOKS = 0.2  # seconds between looks at the render
_SLOT = "XRDS Try"


class XRDS_OT_try_frame(bpy.types.Operator):
    """Render this frame with Cycles and with XRDS in the same seconds, and compare them"""  # noqa: E501  # Blender's tooltip

    bl_idname = "xrds.try_frame"
    bl_label = "Try on This Frame"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and not bpy.app.is_job_running("RENDER")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._begin(context, "EXEC_DEFAULT")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self._begin(context, "INVOKE_DEFAULT")

    def _begin(self, context: bpy.types.Context, how: str) -> set[str]:
        scene = context.scene
        try:
            job = Job(scene, work_of(scene, request_of(scene.xrds)))
        except XRDSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self._job, self._timer, self._slot = job, None, _leave_slot()
        with _no_render_window(context):
            job.begin(how)
        if not job.is_running():
            return self._end(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(_LOOKS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type != "TIMER" or self._job.is_running():
            return {"PASS_THROUGH"}
        return self._end(context)

    def cancel(self, context: bpy.types.Context) -> None:
        self._put_back(context)

    def _put_back(self, context: bpy.types.Context) -> None:
        """Put back all that was changed for the render."""
        self._job.end()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
        _return_to_slot(self._slot)

    def _end(self, context: bpy.types.Context) -> set[str]:
        self._put_back(context)
        try:
            tried = self._job.result()
        except Cancelled:
            self.report({"INFO"}, translated("The try was stopped"))
            return {"CANCELLED"}
        except XRDSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        labels = label(tried.cycles), label(tried.xrds)
        image = split.show((tried.cycles.pixels, tried.xrds.pixels), labels)
        if not bpy.app.background:
            # not in here: Blender forgets to end what opens a window
            bpy.app.timers.register(partial(_open_image, context.window, image))
        for note in (*tried.notes, "; ".join(labels)):
            self.report({"INFO"}, f"XRDS: {note}")
        return {"FINISHED"}


def label(way: Way) -> str:
    """What stands below a picture: who made it, of how many samples, in what time."""
    text = "1 sample" if way.samples == 1 else "{count} samples"
    most = "≤ " if way.at_most else ""
    counted = most + translated(text, count=way.samples)
    return f"{way.name}, {counted}, {duration(way.seconds)}"


@contextmanager
def _no_render_window(context: bpy.types.Context) -> Iterator[None]:
    """Let Blender open nothing for the render that begins."""
    preferences = context.preferences
    view, dirty = preferences.view, preferences.is_dirty
    before = view.render_display_type
    view.render_display_type = "NONE"
    try:
        yield
    finally:
        view.render_display_type = before
        preferences.is_dirty = dirty


def _render_result() -> Any:
    """Blender's image of renders; None before the first."""
    return next((x for x in bpy.data.images if x.type == "RENDER_RESULT"), None)


def _leave_slot() -> int | None:
    """Let the render go into a slot of its own; returns the user's.

    None before the first render, when all are empty.
    """
    image = _render_result()
    if image is None:
        return None
    slots = image.render_slots
    before = int(slots.active_index)
    names = [slot.name for slot in slots]
    if _SLOT not in names:
        slots.new(name=_SLOT)
        names.append(_SLOT)
    slots.active_index = names.index(_SLOT)
    return before


def _return_to_slot(before: int | None) -> None:
    """Go back to the user's slot."""
    image = _render_result()
    if image is not None and before is not None:
        image.render_slots.active_index = before


def _open_image(window: Any, image: Any) -> None:
    """Show the image in an Image Editor, in a new window where none is open."""
    areas = [x for x in window.screen.areas if x.ui_type == "IMAGE_EDITOR"]
    if areas:
        area = max(areas, key=lambda x: x.width * x.height)
    else:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_new()
        window = bpy.context.window_manager.windows[-1]
        area = window.screen.areas[0]
        area.ui_type = "IMAGE_EDITOR"
    area.spaces.active.image = image
    # once a new window has its size
    bpy.app.timers.register(partial(_fit, window, area), first_interval=_LOOKS)


def _fit(window: Any, area: Any) -> None:
    """Show the whole image, and let its line be dragged."""
    region = next(x for x in area.regions if x.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.image.view_all(fit_view=True)
        if bpy.ops.xrds.move_split.poll():
            bpy.ops.xrds.move_split("INVOKE_DEFAULT")


def draw_try(layout: Any, scene: Any, request: Request) -> None:
    """Draw the button, with what the wait will be."""
    text = translated("Try on This Frame")
    wait = expected_wait(scene, request)
    if wait is not None:
        time = duration(wait)
        text = translated("Try on This Frame (about {time})", time=time)
    layout.operator(
        XRDS_OT_try_frame.bl_idname, text=text, icon="IMAGE_REFERENCE", translate=False
    )


def expected_wait(scene: Any, request: Request) -> float | None:
    """Seconds that a try will about take: Cycles' frame, and those of XRDS.

    None where no frame of the scene has been rendered yet.
    """
    settings, known = request.settings, history.scene_settings(scene)
    frames = 2 * settings.temporal_radius + 1
    cycles = replace(settings, mode=Mode.CYCLES_ONLY, denoising=None)
    fewest = replace(settings, mode=Mode.FULL_SIZE, samples=FEWEST)
    first, least = (
        history.seconds(scene, resolved(each, known)) for each in (cycles, fewest)
    )
    if first is None:
        return None
    return first + frames * max(first, least or 0.0)


def register() -> None:
    """Register the operator and what shows its picture."""
    bpy.utils.register_class(XRDS_OT_try_frame)
    split.register()


def unregister() -> None:
    """Take them back."""
    split.unregister()
    bpy.utils.unregister_class(XRDS_OT_try_frame)
