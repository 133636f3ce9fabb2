"""Which passes of light somebody will look at."""

from __future__ import annotations

from typing import Any

from xrds_core.exr.channels import Channels
from xrds_core.light_parts.find import ALL, NONE, Wanted, find_parts

from .contents import requested_passes

# Switches of a view layer.
_LIGHT = {
    *("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect"),
    *("transmission_direct", "transmission_indirect", "volume_direct"),
    *("volume_indirect", "emit", "environment", "shadow_catcher"),
}
_IMAGES = ("OPEN_EXR_MULTILAYER", "MULTILAYER")


def passes_looked_at(scene: Any) -> tuple[str, ...]:
    """All where the file that is written holds them or the compositor reads one.

    As `Wanted` has them.
    """
    is_written = scene.render.image_settings.file_format in _IMAGES
    return (ALL,) if is_written or _is_composited(scene) else (NONE,)


def has_light(layer: Any) -> bool:
    """Whether a view layer has passes of light beside the picture."""
    return bool(len(layer.lightgroups)) or bool(_LIGHT & {*requested_passes(layer)})


def compositor_of(scene: Any) -> Any:
    """The node tree that a render of the scene is to go through; None without one."""
    if not scene.render.use_compositing:
        return None
    if hasattr(scene, "compositing_node_group"):  # Blender 5.0 and later
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def _is_composited(scene: Any) -> bool:
    """Whether a node of the compositor takes light of a view layer."""
    tree = compositor_of(scene)
    read = {
        f"{socket.name}.{letter}": None
        for node in (tree.nodes if tree else ())
        if node.type == "R_LAYERS"
        for socket in node.outputs
        if socket.is_linked
        for letter in "RGB"
    }
    wanted = Wanted((ALL,))
    # a lobe counts without the colour that it was divided by
    lobes = (lobe for renderer in wanted.renderers for lobe in renderer.lobes)
    names = {name for lobe in lobes for name in lobe.colour}
    colours = {f"{name}.{letter}": None for name in names for letter in "RGB"}
    return bool(find_parts(Channels(scene.name, {**read, **colours}), "", wanted))
