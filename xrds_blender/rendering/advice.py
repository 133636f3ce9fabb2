"""What an artist should know of an animation before it is rendered: one line each.

The panel and `xrds plan` show the same lines. Nothing is evaluated here.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from xrds_core.frames import in_words

from ..cycles.view import can_track
from ..planning.plan import SceneFacts, reused_less
from ..planning.request import Request
from ..scene.camera_path import whips
from ..scene.contents import compositor_of, cuts, has_light
from .pace.obstacles import obstacle
from .sampling import has_neighbours

Line = tuple[str, dict[str, object]]
"""A sentence, to be translated, and what is put into it."""

NO_CAMERA = "The scene has no camera: add one"
WHIPS = (
    "The camera swings too fast at {frames}: little of the frames before and after is "
    "in view there"
)
TAKES = "{count} shots: {frames}; nothing is reused across a cut"
NO_FOLDER = "{folder} cannot be written: choose another output folder"
DENOISES_TWICE = (
    "The compositor has a Denoise node: XRDS' picture is denoised already, so mute it"
)
NO_LIGHT = (
    "View layer {layer} has no passes of light: switch them on, or set Passes to None"
)
ALONE = (
    "Frames of such a panorama cannot use each other's samples: each is rendered by "
    "itself"
)


_EXAMINED = 5000  # frames, for swings of the camera


def advice(
    scene: Any, facts: SceneFacts, request: Request, frames: Sequence[int]
) -> list[Line]:
    """All lines that are true of a scene, and of a shot of some frames in order."""
    lines = advice_of_request(scene, request, len(frames))
    if len(frames) > 1 and has_neighbours(scene, request):
        lines += advice_of_shot(scene, facts, frames)
    return [*lines, *advice_of_scene(scene)]


def advice_of_request(scene: Any, request: Request, frames: int) -> list[Line]:
    """Lines on what cannot be as it is requested."""
    if scene.camera is None:
        return [(NO_CAMERA, {})]
    lines: list[Line] = []
    radius = request.settings.temporal_radius
    if frames > 1 and radius and not can_track(scene):
        lines.append((ALONE, {}))
    elif frames > 1 and request.same_picture:
        reason = obstacle(scene, request, frames)
        lines += [(reason, {})] if reason else []
    return lines


def advice_of_passes(scene: Any, request: Request) -> list[Line]:
    """Lines on layers without light; commands have a remark of their own on theirs."""
    if scene.camera is None or not request.light:
        return []
    used = (layer for layer in scene.view_layers if layer.use)
    bare = [layer.name for layer in used if not has_light(layer)]
    return [(NO_LIGHT, {"layer": name}) for name in bare]


def advice_of_shot(scene: Any, facts: SceneFacts, frames: Sequence[int]) -> list[Line]:
    """Lines on cuts, and on what gains less from neighbouring frames."""
    lines: list[Line] = []
    begins = cuts(scene, frames)
    if begins:
        takes = list(_takes(frames, begins))
        lines.append((TAKES, {"count": len(takes), "frames": _join(takes)}))
    swings = [x for x in whips(scene, frames[:_EXAMINED]) if x not in begins]
    if swings:
        lines.append((WHIPS, {"frames": in_words(swings)}))
    return [*lines, *((sentence, {}) for sentence in reused_less(facts))]


def advice_of_scene(scene: Any) -> list[Line]:
    """Lines on the compositor and on where Blender writes its files."""
    tree, lines = compositor_of(scene), [*_unwritable_output(scene)]
    if tree and any(x.type == "DENOISE" and not x.mute for x in tree.nodes):
        lines.append((DENOISES_TWICE, {}))
    return lines


def _unwritable_output(scene: Any) -> Iterator[Line]:
    """A line where the folder that Blender writes to cannot be written."""
    import bpy

    folder = Path(bpy.path.abspath(scene.render.filepath))
    folder = folder if scene.render.filepath.endswith(("/", "\\")) else folder.parent
    there = next((x for x in (folder, *folder.parents) if x.exists()), None)
    if there is None or not there.is_dir() or not os.access(there, os.W_OK):
        yield NO_FOLDER, {"folder": str(folder)}


def _takes(frames: Sequence[int], begins: frozenset[int]) -> Iterator[str]:
    """First and last frame of each take."""
    first = last = frames[0]
    for number in frames:
        if number in begins:
            yield f"{first}–{last}"
            first = number
        last = number
    yield f"{first}–{last}"


_SHOWN = 6  # takes that are named; more would not help a reader


def _join(takes: Sequence[str]) -> str:
    more = ", …" if len(takes) > _SHOWN else ""
    return ", ".join(takes[:_SHOWN]) + more
