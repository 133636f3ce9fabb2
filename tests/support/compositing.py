"""The compositor of a scene, in every Blender."""

from __future__ import annotations

from typing import Any

import bpy


def compositor(scene: Any) -> tuple[Any, Any]:
    """A compositor whose only node so far is the end; (tree, its image socket)."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5.0 and later
        tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket(
            "Image", in_out="OUTPUT", socket_type="NodeSocketColor"
        )
        end = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        end = tree.nodes.new("CompositorNodeComposite")
    return tree, end.inputs[0]
