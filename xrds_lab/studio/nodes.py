"""A terse way to write shader node trees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

Colour = tuple[float, float, float]
Value = Any  # a number, a tuple, or the output socket of another node


class Nodes:
    """Writes one shader node tree."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def add(self, kind: str, /, **values: Value) -> bpy.types.Node:
        """A new node `ShaderNode<kind>`.

        Lower-case names are attributes of the node, the others are its inputs as of
        `fill`.
        """
        node = self.tree.nodes.new("ShaderNode" + kind)
        inputs = {}
        for name, value in values.items():
            if name[0].islower():
                setattr(node, name, value)
            else:
                inputs[name] = value
        self.fill(node, **inputs)
        return node

    def fill(self, node: bpy.types.Node, **inputs: Value) -> None:
        """Plug inputs of a node, `_` for a space in their names; None is left out."""
        for name, value in inputs.items():
            if value is not None:
                self.plug(node.inputs[name.replace("_", " ")], value)

    def plug(self, socket: bpy.types.NodeSocket, value: Value) -> None:
        """Link `value` to `socket` if it is a socket, else make it the default."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value

    def mix(self, a: Value, b: Value, factor: Value, blend: str = "MIX") -> Value:
        """Colours a and b mixed (or blended in mode `blend`) by `factor`."""
        # The Mix node has one set of equally named inputs for each data type.
        node = self.add("Mix", data_type="RGBA", blend_type=blend)
        for index, value in ((0, factor), (6, a), (7, b)):
            self.plug(node.inputs[index], value)
        return node.outputs[2]

    def math(self, operation: str, a: Value, b: Value = 0.0) -> Value:
        """The scalar `operation` of a and b."""
        node = self.add("Math", operation=operation)
        self.plug(node.inputs[0], a)
        self.plug(node.inputs[1], b)
        return node.outputs[0]

    def span(self, value: Value, low: float, high: float) -> Value:
        """`value` in 0..1 brought to low..high."""
        return self.math("ADD", self.math("MULTIPLY", value, high - low), low)

    def ramp(
        self, factor: Value, stops: Sequence[tuple[float, Colour]], mode: str
    ) -> Value:
        """A colour ramp with at least two (position, colour) stops."""
        node = self.add("ValToRGB", Fac=factor)
        ramp = node.color_ramp
        ramp.interpolation = mode
        while len(ramp.elements) < len(stops):
            ramp.elements.new(1.0)
        for element, (position, colour) in zip(
            ramp.elements, sorted(stops), strict=True
        ):
            element.position, element.color = position, (*colour, 1.0)
        return node.outputs["Color"]


class Surface(Nodes):
    """A new material's nodes around its Principled BSDF."""

    def __init__(self, name: str, **principled: Value) -> None:
        self.material = bpy.data.materials.new(name)
        if not self.material.node_tree:
            self.material.use_nodes = True
        super().__init__(self.material.node_tree)
        self.shader = self.tree.nodes["Principled BSDF"]
        self.output = self.tree.nodes["Material Output"]
        self.set(**principled)

    def set(self, **principled: Value) -> None:
        """Plug inputs of the Principled BSDF, as `fill` does."""
        self.fill(self.shader, **principled)

    def replace(self, **outputs: Value) -> None:
        """Plug the material's output with these in place of the Principled BSDF."""
        self.tree.nodes.remove(self.shader)
        self.fill(self.output, **outputs)

    def bump(self, height: Value, distance: float, strength: float = 1.0) -> None:
        """Bend the surface's normal by a height of about `distance` metres."""
        node = self.add("Bump", Height=height, Distance=distance, Strength=strength)
        self.set(Normal=node.outputs[0])


class World(Nodes):
    """A new world's nodes around its Background."""

    def __init__(self, name: str) -> None:
        self.world = bpy.data.worlds.new(name)
        if not self.world.node_tree:
            self.world.use_nodes = True
        super().__init__(self.world.node_tree)

    def light(self, colour: Value = None, strength: Value = None) -> None:
        """Give the Background a colour and a strength."""
        background = self.tree.nodes["Background"]
        self.fill(background, Color=colour, Strength=strength)


def solid(name: str, **principled: Value) -> bpy.types.Material:
    """A material of the Principled BSDF alone."""
    return Surface(name, **principled).material


def air(name: str, density: float) -> bpy.types.Material:
    """A volume that scatters light, without a surface."""
    nodes = Surface(name)
    nodes.replace(Volume=nodes.add("VolumeScatter", Density=density).outputs[0])
    return nodes.material
