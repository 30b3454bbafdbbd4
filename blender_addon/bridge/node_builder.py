"""Adds nodes to a tree from code that reads like arithmetic."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

Socket = bpy.types.NodeSocket


class Builder:
    """Adds nodes to a tree, left to right."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self._tree = tree
        self._column = 0
        self.inputs: dict[str, Socket] = {each.name: each for each in self.node("NodeGroupInput").outputs if each.name}

    def math(self, operation: str, *values: Socket | float) -> Socket:
        """One number of a Math node."""
        node = self.node("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.put(socket, value)
        return node.outputs[0]

    def dot(self, vector: Socket, weights: Sequence[float]) -> Socket:
        """The product with three numbers."""
        node = self.node("ShaderNodeVectorMath")
        node.operation = "DOT_PRODUCT"
        self.put(node.inputs[0], vector)
        node.inputs[1].default_value = [float(each) for each in weights]
        return node.outputs["Value"]

    def combine(self, values: Sequence[Socket | float]) -> Socket:
        """Three numbers as a vector."""
        node = self.node("ShaderNodeCombineXYZ")
        for socket, value in zip(node.inputs, values, strict=True):
            self.put(socket, value)
        return node.outputs[0]

    def separate(self, vector: Socket) -> list[Socket]:
        """A vector as three numbers."""
        node = self.node("ShaderNodeSeparateXYZ")
        self.put(node.inputs[0], vector)
        return list(node.outputs)

    def texel(self, image: bpy.types.Image, column: Socket, row: Socket) -> list[Socket]:
        """The three numbers of a texel.

        Between texels the shader mixes itself: Blender's own filter takes from smaller copies of the
        image wherever neighbouring pixels look up distant places.
        """
        width, height = image.size
        place = self.combine(
            [self.math("MULTIPLY_ADD", column, 1 / width, 0.5 / width),
             self.math("MULTIPLY_ADD", row, 1 / height, 0.5 / height), 0.0]
        )  # fmt: skip
        node = self.node("ShaderNodeTexImage")
        node.image, node.interpolation, node.extension = image, "Closest", "EXTEND"
        self.put(node.inputs[0], place)
        return self.separate(node.outputs["Color"])

    def mix(self, share: Socket, low: Sequence[Socket], high: Sequence[Socket]) -> list[Socket]:
        """Numbers between `low` and `high`."""
        return [
            self.math("MULTIPLY_ADD", share, self.math("SUBTRACT", after, before), before)
            for before, after in zip(low, high, strict=True)
        ]

    def dot_of(self, first: Socket, second: Socket) -> Socket:
        """The product of two vectors."""
        node = self.node("ShaderNodeVectorMath")
        node.operation = "DOT_PRODUCT"
        self.put(node.inputs[0], first)
        self.put(node.inputs[1], second)
        return node.outputs["Value"]

    def vector(self, operation: str, *values: Socket) -> Socket:
        """One vector of a Vector Math node."""
        node = self.node("ShaderNodeVectorMath")
        node.operation = operation
        sockets = [socket for socket in node.inputs if socket.enabled]
        for socket, value in zip(sockets, values, strict=False):
            self.put(socket, value)
        return node.outputs["Vector"]

    def scaled(self, vector: Socket, factor: Socket) -> Socket:
        """A vector times a number."""
        node = self.node("ShaderNodeVectorMath")
        node.operation = "SCALE"
        self.put(node.inputs[0], vector)
        self.put(node.inputs["Scale"], factor)
        return node.outputs["Vector"]

    def matrix(self, rows: Sequence[Sequence[float]], vector: Socket) -> Socket:
        """A constant matrix (3, 3) times a vector."""
        return self.combine([self.dot(vector, row) for row in rows])

    def group(self, tree: bpy.types.NodeTree, value: Socket) -> Socket:
        """The result of another group for one value."""
        node = self.node("ShaderNodeGroup")
        node.node_tree = tree
        self.put(node.inputs[0], value)
        return node.outputs[0]

    def attribute(self, name: str) -> Socket:
        """A number among the scene's custom properties."""
        return self.attributes(name).outputs["Fac"]

    def attributes(self, name: str) -> bpy.types.Node:
        """Four numbers among the scene's custom properties, as ``Vector`` and ``Alpha``."""
        node = self.node("ShaderNodeAttribute")
        node.attribute_type, node.attribute_name = "VIEW_LAYER", name
        return node

    def clamp(self, value: Socket) -> Socket:
        """A number within 0..1."""
        return self.math("MINIMUM", self.math("MAXIMUM", value, 0.0), 1.0)

    def choose(self, condition: Socket, yes: Socket, no: Socket) -> Socket:
        """`yes` where the condition is 1, `no` where it is 0."""
        return self.math("MULTIPLY_ADD", condition, self.math("SUBTRACT", yes, no), no)

    def finish(self, *results: Socket) -> None:
        """Put the results out, in the order of the group's outputs."""
        output = self.node("NodeGroupOutput")
        for socket, result in zip(output.inputs, results, strict=False):
            self.put(socket, result)

    def node(self, kind: str) -> bpy.types.Node:
        """A new node beside the last."""
        node = self._tree.nodes.new(kind)
        node.location = (180 * (self._column // 4), -160 * (self._column % 4))
        self._column += 1
        return node

    def put(self, socket: Socket, value: Socket | float) -> None:
        """Link a socket into another, or set its number."""
        if isinstance(value, bpy.types.NodeSocket):
            self._tree.links.new(value, socket)
        else:
            socket.default_value = float(value)


def new_group(name: str, inputs: dict[str, str], outputs: dict[str, str]) -> bpy.types.NodeTree:
    """A group with sockets of kinds such as ``Vector`` and ``Float``, by name."""
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    for sockets, direction in ((inputs, "INPUT"), (outputs, "OUTPUT")):
        for socket, kind in sockets.items():
            tree.interface.new_socket(socket, in_out=direction, socket_type=f"NodeSocket{kind}")
    return tree
