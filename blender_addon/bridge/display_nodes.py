"""A display profile as a shader node group: XYZ in, what the material must emit out.

Blender's headset path ignores colour management, and the runtime encodes what it is given to sRGB.
So the shader computes the device codes itself and emits their sRGB decoding: the encoding of the
runtime then yields the codes. The steps are those of `spectral_core.display.models.stages`.
"""

from __future__ import annotations

import bpy
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.models.corrected import TOE, TOE_SLOPE
from spectral_core.display.models.stages import SHAPER, SRGB, Interaction, Power, Stages, Tables, stages
from spectral_core.display.profile import DisplayProfile

from .images import empty_image, write_image
from .node_builder import Builder, Socket, new_group

GROUP_KEY = "spectral_booth_display"
# Nodes a side of a 3-D table: in a picture of 65 x 4225 texels, 4.4 MB.
TABLE_NODES = 65
# A square of texels to look the curves up in: between two of 65536 codes differ by 2e-5.
_CURVE_SIDE = 256


def display_group(profile: DisplayProfile, name: str) -> bpy.types.NodeTree:
    """A node group for a profile: ``XYZ`` (white Y = 1) to ``Emission``; codes are clipped to 0..1."""
    tree = new_group(name, {"XYZ": "Vector"}, {"Emission": "Color"})
    tree[GROUP_KEY] = profile.name
    build = Builder(tree)
    codes = _codes(build, build.inputs["XYZ"], stages(profile.model), name)
    build.finish(build.combine([_srgb_decode(build, code) for code in codes]))
    return tree


def remove_group(tree: bpy.types.NodeTree) -> None:
    """Remove a display's node group and the tables that only it shows."""
    images = {node.image for node in tree.nodes if node.type == "TEX_IMAGE" and node.image is not None}
    bpy.data.node_groups.remove(tree)
    for image in images:
        if not image.users:
            bpy.data.images.remove(image)


def _codes(build: Builder, XYZ: Socket, steps: Stages, name: str) -> list[Socket]:
    drive = [
        build.math("ADD", build.dot(XYZ, row), offset) for row, offset in zip(steps.matrix, steps.offset, strict=True)
    ]
    if isinstance(interaction := steps.interaction, Interaction):
        drive = _interaction(build, [_lightness(build, each) for each in drive], interaction, name)
    drive = [build.clamp(each) for each in drive]
    curve = steps.curve
    if isinstance(curve, Tables):
        return _tables(build, drive, curve, name)
    if isinstance(curve, Power):
        powers = [build.math("POWER", each, 1 / gamma) for each, gamma in zip(drive, curve.gamma, strict=True)]
        pairs = zip(powers, curve.threshold, strict=True)
        return [build.clamp(build.math("MULTIPLY_ADD", each, 1 - low, low)) if low else each for each, low in pairs]
    assert isinstance(curve, SRGB)
    return [_srgb_encode(build, each) for each in drive]


def _lightness(build: Builder, drive: Socket) -> Socket:
    """CIE 1976 lightness; its line goes on below zero."""
    root = build.math("POWER", build.math("MAXIMUM", drive, TOE), 1 / 3)
    line = build.math("SUBTRACT", build.math("MINIMUM", drive, TOE), TOE)
    return build.math("MULTIPLY_ADD", line, TOE_SLOPE, build.math("MULTIPLY_ADD", root, 1.16, -0.16))


def _interaction(build: Builder, lightness: list[Socket], interaction: Interaction, name: str) -> list[Socket]:
    """The 3-D table, trilinear, its layers of blue one above the other in an image."""
    n = TABLE_NODES
    low, high = interaction.span
    image = _image(f"{name} interaction", interaction.sampled(n).transpose(2, 1, 0, 3).reshape(n * n, n, 3))
    scales = (n - 1) / (high - low)
    places = [
        build.math(
            "MULTIPLY", build.clamp(build.math("MULTIPLY_ADD", each, scale / (n - 1), -bottom * scale / (n - 1))), n - 1
        )
        for each, bottom, scale in zip(lightness, low, scales, strict=True)
    ]
    cells = [build.math("MINIMUM", build.math("FLOOR", place), n - 2) for place in places]
    rests = [build.math("SUBTRACT", place, cell) for place, cell in zip(places, cells, strict=True)]
    r, g, b = ([cell, build.math("ADD", cell, 1.0)] for cell in cells)
    layers = []
    for layer in b:
        rows = []
        for row in g:
            at = build.math("MULTIPLY_ADD", layer, n, row)
            rows.append(build.mix(rests[0], *(build.texel(image, column, at) for column in r)))
        layers.append(build.mix(rests[1], *rows))
    return build.mix(rests[2], *layers)


def _tables(build: Builder, drive: list[Socket], curve: Tables, name: str) -> list[Socket]:
    side = _CURVE_SIDE
    image = _image(f"{name} curves", curve.sampled(side**2).reshape(side, side, 3))
    codes = []
    for channel, each in enumerate(drive):
        number = build.math("ROUND", build.math("MULTIPLY", build.math("POWER", each, SHAPER), side**2 - 1))
        row = build.math("FLOOR", build.math("MULTIPLY", number, 1 / side))
        column = build.math("MULTIPLY_ADD", row, -side, number)
        codes.append(build.texel(image, column, row)[channel])
    return codes


def _srgb_decode(build: Builder, code: Socket) -> Socket:
    """IEC 61966-2-1, for codes from 0."""
    curve = build.math("POWER", build.math("MULTIPLY_ADD", code, 1 / 1.055, 0.055 / 1.055), 2.4)
    return build.choose(build.math("GREATER_THAN", code, 0.04045), curve, build.math("MULTIPLY", code, 1 / 12.92))


def _srgb_encode(build: Builder, linear: Socket) -> Socket:
    """IEC 61966-2-1, for values from 0."""
    curve = build.math("MULTIPLY_ADD", build.math("POWER", linear, 1 / 2.4), 1.055, -0.055)
    line = build.math("MULTIPLY", linear, 12.92)
    return build.choose(build.math("GREATER_THAN", linear, 0.0031308), curve, line)


def _image(name: str, rows: Float64Array) -> bpy.types.Image:
    """A table (height, width, 3) as an image in full floats, row 0 at the bottom (v = 0)."""
    height, width, _ = rows.shape
    image = empty_image(name, width, height)
    write_image(image, rows[::-1].astype(np.float32))
    return image
