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
        """A new node ``ShaderNode<kind>``.

        Lower-case names are attributes of the node, the others are its inputs with
        ``_`` for a space; an input given a socket is linked, else set.
        """
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in values.items():
            if name[0].islower():
                setattr(node, name, value)
            else:
                self.plug(node.inputs[name.replace("_", " ")], value)
        return node

    def plug(self, socket: bpy.types.NodeSocket, value: Value) -> None:
        """Link ``value`` to ``socket`` if it is a socket, else make it the default."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value

    def mix(self, a: Value, b: Value, factor: Value, blend: str = "MIX") -> Value:
        """Colours a and b mixed (or blended in mode ``blend``) by ``factor``."""
        # The Mix node has one set of equally named inputs for each data type.
        node = self.add("Mix", data_type="RGBA", blend_type=blend)
        for index, value in ((0, factor), (6, a), (7, b)):
            self.plug(node.inputs[index], value)
        return node.outputs[2]

    def math(self, operation: str, a: Value, b: Value = 0.0) -> Value:
        """The scalar ``operation`` of a and b."""
        node = self.add("Math", operation=operation)
        self.plug(node.inputs[0], a)
        self.plug(node.inputs[1], b)
        return node.outputs[0]

    def span(self, value: Value, low: float, high: float) -> Value:
        """``value`` in 0..1 brought to low..high."""
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
