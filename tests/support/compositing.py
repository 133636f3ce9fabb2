"""The compositor of a scene, in every Blender."""

from __future__ import annotations

from typing import Any

import bpy


def empty_compositor(scene: Any) -> Any:
    """The node tree of a compositor, without any node."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5.0 and later
        scene.compositing_node_group = bpy.data.node_groups.new(
            "compositor", "CompositorNodeTree"
        )
        return scene.compositing_node_group
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree


def compositor(scene: Any) -> tuple[Any, Any]:
    """A compositor whose only node so far is the end; (tree, its image socket)."""
    tree = empty_compositor(scene)
    if not hasattr(scene, "compositing_node_group"):
        return tree, tree.nodes.new("CompositorNodeComposite").inputs[0]
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return tree, tree.nodes.new("NodeGroupOutput").inputs[0]
