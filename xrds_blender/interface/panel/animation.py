"""What an animation takes in Cycles, and what XRDS offers, with a button for each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ...planning.offers import (
    Kind,
    Offer,
    Offers,
    cycles_line,
    offer_line,
    source_line,
)
from ...planning.request import Request
from ...planning.settings import Mode
from ...rendering.advice import advice_of_passes, advice_of_request
from ...rendering.modes import offers_of
from ...scene.contents import frame_range
from ..translations import CONTEXT
from . import paragraph, scene_cache
from .paragraph import translated


class XRDS_OT_take_offer(bpy.types.Operator):
    """Set the scene up for this; its samples stay as they are"""

    bl_idname = "xrds.take_offer"
    bl_label = "Use"
    bl_translation_context = CONTEXT
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        items=[(kind.value, kind.name, "") for kind in Kind], options={"HIDDEN"}
    )
    seconds: bpy.props.FloatProperty(min=0.0, options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.xrds
        settings.mode, settings.use_time_budget = Mode.AUTOMATIC, False
        settings.animation = self.kind
        if self.kind == Kind.TIME:
            settings.deadline = self.seconds
        return {"FINISHED"}


_TEXT = 0.8  # of the row, beside its button


def draw(layout: Any, context: Any, request: Request) -> None:
    """Draw what the scene's animation takes, and the offers."""
    scene = context.scene
    found = offers_of(scene, request, len(frame_range(scene)))
    column = layout.column(align=True)
    paragraph.draw(column, context, cycles_line(found, translated))
    for offer in found.offers:
        _draw_offer(column, context, offer, found)
    paragraph.draw(column, context, source_line(found, translated))


def _draw_offer(layout: Any, context: Any, offer: Offer, found: Offers) -> None:
    row = layout.split(factor=_TEXT, align=True)
    sentence = offer_line(offer, found.animation, translated)
    paragraph.draw(row, context, sentence, share=_TEXT)
    taken = context.scene.xrds.animation == offer.kind
    use = row.operator(XRDS_OT_take_offer.bl_idname, depress=taken)
    use.kind = offer.kind.value
    use.seconds = offer.seconds or 0.0


def notes(scene: Any, request: Request) -> Iterator[str]:
    """Translated lines on what the scene asks for, where they are true."""
    known = scene_cache.seen(scene, scene.view_layers[0])
    if known is None:
        return
    frames = len(frame_range(scene)) if scene_cache.is_animation(scene) else 1
    lines = advice_of_request(scene, request, frames)
    lines += advice_of_passes(scene, request)
    if scene_cache.is_shot(scene, request):
        lines += known.of_shot
    for sentence, values in [*lines, *known.of_scene]:
        yield translated(sentence, **values)
