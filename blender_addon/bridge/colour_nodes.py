"""Node groups that all materials of a scene share: coefficients to colours, light per channel to XYZ."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from spectral_core.coded import CHANNELS
from spectral_core.standards import srgb_to_XYZ_matrix

from . import live
from .node_builder import Builder, Socket, new_group

COLOURS = tuple(f"Colour {channel + 1}" for channel in range(CHANNELS))
REFERENCE = "Reference"
# 1 where a surface has an RGB colour of its own for levels 0 and 1, and is not computed from its coefficients.
HAS_REFERENCE = "Has Reference"


def coefficients(index: int) -> tuple[str, str]:
    """Names of the inputs for four coefficients: three and one, as in an image's colour and alpha."""
    return f"Coefficients {4 * index + 1} to {4 * index + 3}", f"Coefficient {4 * index + 4}"


def basis_group(name: str, quads: int, coded: bool) -> bpy.types.NodeTree:
    """Coefficients (4 * quads) to what a surface carries: one colour, or its XYZ per channel of coded lamps."""
    sockets = [coefficients(index) for index in range(quads)]
    kinds = {name: kind for pair in sockets for name, kind in zip(pair, ("Vector", "Float"), strict=True)}
    shown = COLOURS if coded else COLOURS[:1]
    tree = new_group(name, {**kinds, REFERENCE: "Vector", HAS_REFERENCE: "Float"}, dict.fromkeys(shown, "Vector"))
    build = Builder(tree)
    inputs = [(build.inputs[first], build.inputs[last]) for first, last in sockets]
    # At level 2, and for surfaces without a reference of their own, the coefficients alone count.
    unmanaged = build.math("SUBTRACT", 1.0, build.attribute(live.SPECTRAL))
    share = build.math("MULTIPLY", build.inputs[HAS_REFERENCE], unmanaged)
    results = []
    for channel in range(len(shown)):
        exact = build.combine([_product(build, channel, row, inputs) for row in range(3)])
        reference = build.inputs[REFERENCE]
        if coded:
            lamp = build.attributes(live.lamp_rgb(channel)).outputs["Vector"]
            reference = build.matrix(srgb_to_XYZ_matrix(), build.vector("MULTIPLY", reference, lamp))
        change = build.scaled(build.vector("SUBTRACT", reference, exact), share)
        colour = build.vector("ADD", exact, change)
        results.append(build.vector("MAXIMUM", colour, build.combine([0.0, 0.0, 0.0])))
    build.finish(*results)
    return tree


def _product(build: Builder, channel: int, row: int, inputs: Sequence[tuple[Socket, Socket]]) -> Socket:
    """A row of a channel's matrix times the coefficients."""
    total: Socket | None = None
    for index, (three, fourth) in enumerate(inputs):
        weights = build.attributes(live.quad(channel, row, index))
        dot = build.dot_of(three, weights.outputs["Vector"])
        part = build.math("MULTIPLY_ADD", fourth, weights.outputs["Alpha"], dot)
        total = part if total is None else build.math("ADD", total, part)
    assert total is not None
    return total


def coded_group(name: str) -> bpy.types.NodeTree:
    """Light per channel, diffuse and from gloss, and a surface's XYZ per channel to the XYZ that leaves it."""
    tree = new_group(
        name, {"Diffuse": "Vector", "Gloss": "Vector", **dict.fromkeys(COLOURS, "Vector")}, {"XYZ": "Vector"}
    )
    build = Builder(tree)
    diffuse, gloss = build.separate(build.inputs["Diffuse"]), build.separate(build.inputs["Gloss"])
    total: Socket | None = None
    for channel, colour in enumerate(COLOURS):
        white = build.attributes(live.white_XYZ(channel)).outputs["Vector"]
        for vector, light in ((build.inputs[colour], diffuse[channel]), (white, gloss[channel])):
            part = build.scaled(vector, light)
            total = part if total is None else build.vector("ADD", total, part)
    assert total is not None
    build.finish(total)
    return tree
