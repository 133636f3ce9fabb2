"""What a render by the command leaves out of a file, and what the file itself lacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..planning.request import Request
from .contents import compositor_of, has_light
from .outer_files import OuterFile, outer_files
from .strength import weak_objects

# Nodes without which a compositor gives the render itself.
_PLAIN = {"R_LAYERS", "COMPOSITE", "VIEWER", "GROUP_OUTPUT", "FRAME", "REROUTE"}
_BY_BLENDER = "blender -b with the engine XRDS does"
_MOST_NAMED = 3


def remarks(scene: Any, request: Request) -> list[str]:
    """A line for each thing that the pictures will not show though the file asks."""
    return [
        *_find_left_out(scene),
        *_without_light(scene, request),
        *_without_strength(scene, request),
        *missing(),
    ]


def _find_left_out(scene: Any) -> Iterator[str]:
    render = scene.render
    tree = compositor_of(scene)
    if tree and any(node.type not in _PLAIN and not node.mute for node in tree.nodes):
        yield f"the compositor is not run; {_BY_BLENDER}"
    sequences = render.use_sequencer and scene.sequence_editor
    if sequences and len(_strips(sequences)):
        yield "the scene is rendered, not the video sequence that the file has"
    if render.use_freestyle:
        yield f"Freestyle's lines are not drawn; {_BY_BLENDER}"
    if render.use_stamp:
        yield f"metadata is not burnt into the pictures; {_BY_BLENDER}"
    used = [layer.name for layer in scene.view_layers if layer.use]
    if used[1:]:
        yield (
            f"view layer {used[0]!r} alone is rendered, not {_join_names(used[1:])}; "
            "--view-layer chooses"
        )
    if "MULTILAYER" in render.image_settings.file_format:
        yield (
            "the picture is written without the file's other passes; --passes all "
            f"writes those of light, {_BY_BLENDER} all"
        )


def _strips(editor: Any) -> Any:
    return editor.strips if hasattr(editor, "strips") else editor.sequences


def _without_light(scene: Any, request: Request) -> Iterator[str]:
    layer = next((layer for layer in scene.view_layers if layer.use), None)
    if request.light and layer is not None and not has_light(layer):
        yield (
            f"view layer {layer.name!r} has no passes of light: --passes adds none; "
            "switch them on in the file"
        )


def _without_strength(scene: Any, request: Request) -> Iterator[str]:
    """Above scale 1 frames have neighbours, but no pass tells their objects."""
    settings = request.settings
    if not (settings.is_enlarged and settings.temporal_radius):
        return
    if weak := [item.name for item in weak_objects(scene.objects)]:
        yield f"the strength of {_join_names(weak)} counts at --scale 1 alone"


def missing() -> Iterator[str]:
    """A line for each kind of files that are not there."""
    gone = [file for file in outer_files() if file.missing]
    kinds = {"image": "textures, which render pink", "library": "libraries"}
    for kind in (*kinds, ""):
        files = [
            file for file in gone if (file.kind if file.kind in kinds else "") == kind
        ]
        if files:
            yield f"missing {kinds.get(kind, 'files')}: {_name_files(files)}"


def _name_files(files: list[OuterFile]) -> str:
    return _join_names([f"{file.missing} ({file.owner})" for file in files])


def _join_names(names: list[str]) -> str:
    more = len(names) - _MOST_NAMED
    return ", ".join(names[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
