"""How much the samples of neighbour frames count: in a scene, and on its objects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..planning.request import Request
from .keyframes import curves

_PATH = "xrds.strength"
SEEN = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD"}
"""Types of objects that a camera's ray may hit; a volume has no surface."""


def strength_of(scene: Any, request: Request) -> float:
    """How much neighbours count in the frame that a scene is at, 0 to 1."""
    requested = request.settings.strength
    own = scene.xrds.strength if requested is None else requested
    return own if own < 1.0 else 1.0  # for NaN, too, which a script may set


def neighbours_count(scene: Any, request: Request) -> bool:
    """Whether neighbours count at all, in any frame."""
    return is_keyed(scene, request) or strength_of(scene, request) > 0.0


def is_keyed(scene: Any, request: Request) -> bool:
    """Whether keyframes or a driver of the scene decide how much neighbours count."""
    data = scene.animation_data
    if data is None or request.settings.strength is not None:
        return False
    strips = (strip for track in data.nla_tracks for strip in track.strips)
    actions = [data.action, *(strip.action for strip in strips)]
    found = [c for action in actions if action for c in curves(action)]
    return any(curve.data_path == _PATH for curve in (*found, *data.drivers))


def weak_objects(items: Iterable[Any]) -> list[Any]:
    """Those of some data-blocks that are objects on which neighbours count less."""
    import bpy

    objects = (item for item in items if isinstance(item, bpy.types.Object))
    return [x for x in objects if x.type in SEEN and x.xrds_strength < 1.0]


def shows_indices(depsgraph: Any) -> bool:
    """Whether the objects' indices are in a pass, or a shader may read them."""
    import bpy

    if depsgraph.view_layer_eval.use_pass_object_index:
        return True
    kind = bpy.types.NodeTree
    trees = (
        x if isinstance(x, kind) else getattr(x, "node_tree", None)
        for x in depsgraph.ids
    )
    return any(_reads_index(node) for tree in trees if tree for node in tree.nodes)


def _reads_index(node: Any) -> bool:
    if node.type == "ATTRIBUTE":
        return bool(node.attribute_name == "pass_index")
    return node.type in {"OBJECT_INFO", "SCRIPT"}
