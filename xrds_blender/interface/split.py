"""Two pictures in an Image Editor, with a line between them that the mouse drags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from xrds_core.arrays import Array

from ..internals.lifetimes import FILE, PROCESS
from ..rendering.split import draw_split, line_width, split_picture

IMAGE = "XRDS Try"
_MARGIN, _POINTS = 12, 14  # of labels, at an interface scale of 1


@dataclass
class Shown:
    """What the image holds: two pictures (H, W, 4), the lowest row first, with labels.

    The line is at the column `place`.
    """

    left: Array | None = None
    right: Array | None = None
    labels: tuple[str, str] = ("", "")
    place: int = 0
    mixed: Array = field(default_factory=lambda: np.empty((0, 0, 4), np.float32))


def show(pictures: Sequence[Array], labels: tuple[str, str]) -> Any:
    """Make or fill the image with two pictures (H, W, 4), row 0 on top; returns it."""
    left, right = (np.ascontiguousarray(x[::-1], np.float32) for x in pictures)
    height, width = left.shape[:2]
    image = bpy.data.images.get(IMAGE)
    if image is None or tuple(image.size) != (width, height):
        if image is not None:
            bpy.data.images.remove(image)
        image = bpy.data.images.new(IMAGE, width, height, alpha=True, float_buffer=True)
        image.alpha_mode = "PREMUL"
        image.use_view_as_render = True
    shown = FILE.of(Shown)
    shown.left, shown.right, shown.labels = left, right, labels
    shown.mixed, shown.place = split_picture(left, right), width // 2
    image.pixels.foreach_set(shown.mixed.ravel())
    image.update()
    return image


def move_to(image: Any, place: int) -> None:
    """Move the line to a column."""
    shown = FILE.of(Shown)
    assert shown.left is not None
    assert shown.right is not None
    place = min(max(place, 0), shown.mixed.shape[1] - line_width(shown.mixed.shape[1]))
    if place != shown.place:
        draw_split(shown.mixed, shown.left, shown.right, place, shown.place)
        shown.place = place
        image.pixels.foreach_set(shown.mixed.ravel())
        image.update()


def _is_shown(space: Any) -> bool:
    """Whether an Image Editor shows the image, with its pictures still there."""
    image = getattr(space, "image", None)
    return image is not None and image.name == IMAGE and FILE.of(Shown).left is not None


class XRDS_OT_move_split(bpy.types.Operator):
    """Drag the line between Cycles' picture and that of XRDS. Esc or a right click ends it"""  # noqa: E501  # Blender's tooltip

    bl_idname = "xrds.move_split"
    bl_label = "Drag the Line"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        running = context.window.modal_operators if context.window else ()
        if any(each.bl_idname == cls.__name__ for each in running):
            return False
        return _is_shown(context.space_data)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._area, self._drags = context.area, False
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        screen = context.screen
        if self._area not in (screen.areas.values() if screen else ()):
            return {"FINISHED"}
        space = self._area.spaces.active
        if not _is_shown(space) or event.type in {"ESC", "RIGHTMOUSE"}:
            context.workspace.status_text_set(None)
            return {"FINISHED"}
        region = next(x for x in self._area.regions if x.type == "WINDOW")
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if event.type == "LEFTMOUSE":
            inside = 0 <= x < region.width and 0 <= y < region.height
            self._drags = event.value == "PRESS" and inside
            if not inside:
                return {"PASS_THROUGH"}
        elif event.type != "MOUSEMOVE" or not self._drags:
            return {"PASS_THROUGH"}
        if self._drags:
            across, _ = region.view2d.region_to_view(x, y)
            move_to(space.image, round(across * space.image.size[0]))
            region.tag_redraw()
        return {"RUNNING_MODAL"}


def draw_labels() -> None:
    """Draw what the halves are into the lower corners of the picture."""
    import blf

    context = bpy.context
    if not _is_shown(context.space_data):
        return
    scale, view = context.preferences.system.ui_scale, context.region.view2d
    left, bottom = view.view_to_region(0.0, 0.0, clip=False)
    right, _ = view.view_to_region(1.0, 0.0, clip=False)
    margin = _MARGIN * scale
    left, right = max(left, 0) + margin, min(right, context.region.width) - margin
    first, second = FILE.of(Shown).labels
    blf.size(0, _POINTS * scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 6, 0.0, 0.0, 0.0, 1.0)
    for text, x in ((first, left), (second, right - blf.dimensions(0, second)[0])):
        blf.position(0, x, max(bottom, 0) + margin, 0.0)
        blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def draw_button(self: Any, context: bpy.types.Context) -> None:
    """Draw the button into the Image Editor's header."""
    if _is_shown(context.space_data):
        self.layout.operator(XRDS_OT_move_split.bl_idname, icon="ARROW_LEFTRIGHT")


@dataclass
class _Handler:
    """Blender's handle of what draws the labels."""

    handle: Any = None


def register() -> None:
    """Register the operator, the button and the labels."""
    bpy.utils.register_class(XRDS_OT_move_split)
    bpy.types.IMAGE_HT_header.append(draw_button)
    PROCESS.of(_Handler).handle = bpy.types.SpaceImageEditor.draw_handler_add(
        draw_labels, (), "WINDOW", "POST_PIXEL"
    )


def unregister() -> None:
    """Take them back."""
    handle = PROCESS.of(_Handler).handle
    bpy.types.SpaceImageEditor.draw_handler_remove(handle, "WINDOW")
    bpy.types.IMAGE_HT_header.remove(draw_button)
    bpy.utils.unregister_class(XRDS_OT_move_split)
