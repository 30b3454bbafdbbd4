"""What is put round a material's base: where its colour comes from, and what happens to lit light.

A `Shading` says how a scene is shown; `apply` puts it round a base, `remove` takes it away and leaves the
base as it was. Nothing here depends on the light: that is in the scene's live properties, in images, or in the
constants that `set_colours` writes.

    baked colours | coefficients -> basis group          -> base -> output             coloured lamps
                                                                 -> display -> output  (headset)
                                                -> white base -> lit -> coded group -> display -> output  coded lamps
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import BlenderError

from . import colour_nodes, live, materials, state
from .images import read_image, write_image

OVERLAY_KEY = "spectral_booth_overlay"
IMAGE = "Spectral Image"
COLOUR = "Spectral Colour"
LIT, CODED, DISPLAY, EMISSION = "Spectral Lit", "Spectral Coded", "Spectral Display", "Spectral Emission"

# Properties of a node that are not what it computes.
_OF_THE_NODE_ITSELF = {
    "name", "label", "location", "location_absolute", "parent", "width", "height", "color", "use_custom_color",
    "select", "hide", "mute", "show_options", "show_preview", "show_texture", "warning_propagation",
}  # fmt: skip

Socket = bpy.types.NodeSocket


@dataclass(frozen=True)
class Shading:
    """How the materials of a scene are shown; node groups are shared by all of them.

    Attributes
    ----------
    basis
        Coefficients to colours; None where colours are baked.
    coded
        Light per channel to XYZ; None for coloured lamps.
    display
        What leaves a surface (XYZ with coded lamps, else linear Rec.709) to what it must emit; None if
        that is the same.
    """

    basis: bpy.types.NodeTree | None
    coded: bpy.types.NodeTree | None
    display: bpy.types.NodeTree | None

    @property
    def colours(self) -> int:
        """How many colours a surface carries: one, or one per channel."""
        return len(colour_nodes.COLOURS) if self.coded else 1


def apply(material: bpy.types.Material, shading: Shading, images: Sequence[bpy.types.Image]) -> None:
    """Put a shading round a material's base; `images` are those of a textured surface, none of a uniform one."""
    remove(material)
    build = _Overlay(material)
    sources = _sources(build, shading, images)
    if shading.coded is None:
        for source in sources:
            build.link(source, materials.colour_socket(material))
        _tint_gloss(build)
        shader = materials.base_shader(material)
        if shading.display is not None:
            shader = build.emit(build.through(shading.display, build.lit(shader)))
    else:
        shader = build.emit(build.through(shading.display, _coded(build, shading.coded, sources)))
    materials.show(material, shader)


def remove(material: bpy.types.Material) -> None:
    """Take away what `apply` put there."""
    nodes = material.node_tree.nodes
    socket = materials.colour_socket(material)
    for node in [each for each in nodes if OVERLAY_KEY in each]:
        nodes.remove(node)
    materials.show(material, materials.base_shader(material))
    if materials.PRINCIPLED_KEY not in material:
        socket.default_value = (1.0, 1.0, 1.0, 1.0)


def set_colours(material: bpy.types.Material, colours: Sequence[Float64Array]) -> None:
    """Bake colours into a material: each (3,), or (height, width, 3) from the top; one, or one per channel.

    Negative values do not exist in Blender's working space: they become 0, which `verify` counts.

    Raises
    ------
    BlenderError
        If a user removed an image.
    """
    nodes = material.node_tree.nodes
    for index, colour in enumerate(colours):
        kept = np.maximum(colour, 0.0)
        if colour.ndim > 1:
            image = nodes[_numbered(IMAGE, index)].image
            if image is None:
                raise BlenderError(f"'{material.name}' has lost an image of its colours", remedy="use Bake Colours")
            write_image(image, kept.astype(np.float32))
        elif CODED in nodes:
            nodes[CODED].inputs[colour_nodes.COLOURS[index]].default_value = kept.tolist()
        else:
            materials.colour_socket(material).default_value = (*kept.tolist(), 1.0)


def set_coefficients(material: bpy.types.Material, coefficients: Float64Array, reference_rgb: Float64Array) -> None:
    """Give a uniform surface its coefficients (4 * quads,) and its RGB for levels 0 and 1 (3,)."""
    inputs = material.node_tree.nodes[COLOUR].inputs
    for index in range(len(coefficients) // 4):
        first, last = colour_nodes.coefficients(index)
        inputs[first].default_value = coefficients[4 * index : 4 * index + 3].tolist()
        inputs[last].default_value = float(coefficients[4 * index + 3])
    inputs[colour_nodes.REFERENCE].default_value = reference_rgb.tolist()
    inputs[colour_nodes.HAS_REFERENCE].default_value = 1.0


def stored_coefficients(material: bpy.types.Material) -> Float64Array:
    """Coefficients (..., 4 * quads) as the material holds them: of a uniform surface, or (height, width)."""
    nodes = material.node_tree.nodes
    images = images_of(material)
    if images:
        return np.concatenate([read_image(image) for image in images], axis=-1).astype(np.float64)
    values: list[float] = []
    for socket in nodes[COLOUR].inputs:
        if socket.name.startswith("Coefficient"):
            values += [socket.default_value] if socket.type == "VALUE" else socket.default_value[:]
    return np.array(values)


def stored_reference(material: bpy.types.Material) -> Float64Array | None:
    """RGB (3,) of a uniform surface for levels 0 and 1, None if it has none of its own."""
    inputs = material.node_tree.nodes[COLOUR].inputs
    if not inputs[colour_nodes.HAS_REFERENCE].default_value:
        return None
    return np.array(inputs[colour_nodes.REFERENCE].default_value)


def stored_colours(material: bpy.types.Material) -> list[Float64Array]:
    """Baked colours as the material holds them: each (3,) or (height, width, 3)."""
    images, nodes = images_of(material), material.node_tree.nodes
    if images:
        return [read_image(image)[..., :3].astype(np.float64) for image in images]
    if CODED in nodes:
        return [np.array(nodes[CODED].inputs[name].default_value) for name in colour_nodes.COLOURS]
    return [np.array(materials.colour_socket(material).default_value[:3], dtype=np.float64)]


def images_of(material: bpy.types.Material) -> list[bpy.types.Image]:
    """The images of a textured surface, in order."""
    found = [node for node in material.node_tree.nodes if OVERLAY_KEY in node and node.type == "TEX_IMAGE"]
    return [node.image for node in sorted(found, key=lambda node: node.name) if node.image is not None]


def images_in(scene: bpy.types.Scene) -> list[bpy.types.Image]:
    """The images of all textured surfaces of a scene."""
    return [image for material in state.all_managed_materials(scene) for image in images_of(material)]


def show_before_display(material: bpy.types.Material) -> bool:
    """Show what leaves the surface, not yet turned into a display's codes; False if it shows that anyway."""
    nodes = material.node_tree.nodes
    if DISPLAY not in nodes:
        return False
    if CODED in nodes:
        material.node_tree.links.new(nodes[CODED].outputs[0], nodes[EMISSION].inputs["Color"])
    else:
        materials.show(material, materials.base_shader(material))
    return True


def show_after_display(material: bpy.types.Material) -> None:
    """Undo `show_before_display`."""
    nodes = material.node_tree.nodes
    material.node_tree.links.new(nodes[DISPLAY].outputs[0], nodes[EMISSION].inputs["Color"])
    materials.show(material, nodes[EMISSION].outputs[0])


class _Overlay:
    """Adds nodes that `remove` finds again."""

    def __init__(self, material: bpy.types.Material) -> None:
        self.material = material
        self._count = 0

    def node(self, kind: str, name: str) -> bpy.types.Node:
        node = self.material.node_tree.nodes.new(kind)
        node.name = node.label = name
        node[OVERLAY_KEY] = True
        node.location = (-700 + 220 * (self._count // 3), 320 + 260 * (self._count % 3))
        self._count += 1
        return node

    def link(self, source: Socket, target: Socket) -> None:
        self.material.node_tree.links.new(source, target)

    def lit(self, shader: Socket) -> Socket:
        """The light that leaves a shader, as a colour."""
        node = self.node("ShaderNodeShaderToRGB", LIT)
        self.link(shader, node.inputs[0])
        return node.outputs["Color"]

    def through(self, tree: bpy.types.NodeTree | None, value: Socket) -> Socket:
        if tree is None:
            return value
        node = self.node("ShaderNodeGroup", DISPLAY)
        node.node_tree = tree
        self.link(value, node.inputs[0])
        return node.outputs[0]

    def emit(self, colour: Socket) -> Socket:
        node = self.node("ShaderNodeEmission", EMISSION)
        self.link(colour, node.inputs["Color"])
        return node.outputs[0]


def _sources(build: _Overlay, shading: Shading, images: Sequence[bpy.types.Image]) -> list[Socket]:
    """The sockets of a surface's colours; none where they are constants without nodes of their own."""
    pictures = []
    for index, image in enumerate(images):
        node = build.node("ShaderNodeTexImage", _numbered(IMAGE, index))
        node.image = image
        pictures.append(node)
        if materials.PLACE_KEY in build.material:
            kept = json.loads(build.material[materials.PLACE_KEY])
            place = materials.output_of(build.material.node_tree, *kept)
            if place is not None:
                build.link(place, node.inputs["Vector"])
    if shading.basis is None:
        return [node.outputs["Color"] for node in pictures]
    node = build.node("ShaderNodeGroup", COLOUR)
    node.node_tree = shading.basis
    for index, picture in enumerate(pictures):
        for name, output in zip(colour_nodes.coefficients(index), ("Color", "Alpha"), strict=True):
            build.link(picture.outputs[output], node.inputs[name])
    return list(node.outputs)


def _tint_gloss(build: _Overlay) -> None:
    """Let a user's own neutral gloss have the light's colour where the lamps do not carry it."""
    tint = materials.colour_socket(build.material).node.inputs.get("Specular Tint")
    if tint is not None and not tint.links and all(value == 1.0 for value in tint.default_value):
        node = build.node("ShaderNodeAttribute", "Spectral Gloss Colour")
        node.attribute_type, node.attribute_name = "VIEW_LAYER", live.GLOSS
        build.link(node.outputs["Color"], tint)


def _coded(build: _Overlay, tree: bpy.types.NodeTree, sources: Sequence[Socket]) -> Socket:
    """XYZ that leaves the surface, from its XYZ per channel and the lit base."""
    material = build.material
    node = build.node("ShaderNodeGroup", CODED)
    node.node_tree = tree
    for source, name in zip(sources, colour_nodes.COLOURS, strict=False):
        build.link(source, node.inputs[name])
    base = materials.colour_socket(material)
    base.default_value = (1.0, 1.0, 1.0, 1.0)
    lit = build.lit(base.node.outputs[0])
    if materials.PRINCIPLED_KEY in material:
        # Principled is a sum of its colour times something, and of something else: white less black is the first.
        black = build.lit(_black_twin(build, base.node).outputs[0])
        difference = build.node("ShaderNodeVectorMath", "Spectral Diffuse Light")
        difference.operation = "SUBTRACT"
        build.link(lit, difference.inputs[0])
        build.link(black, difference.inputs[1])
        build.link(difference.outputs[0], node.inputs["Diffuse"])
        build.link(black, node.inputs["Gloss"])
        return node.outputs[0]
    build.link(lit, node.inputs["Diffuse"])
    gloss = materials.gloss_shader(material)
    if gloss is not None:
        build.link(build.lit(gloss), node.inputs["Gloss"])
    return node.outputs[0]


def _black_twin(build: _Overlay, node: bpy.types.Node) -> bpy.types.Node:
    """A copy of a shader node with all that leads into it, but black."""
    twin = build.node(node.bl_idname, "Spectral Black")
    for each in node.bl_rna.properties:
        if not each.is_readonly and each.identifier not in _OF_THE_NODE_ITSELF:
            setattr(twin, each.identifier, getattr(node, each.identifier))
    for socket, copied in zip(node.inputs, twin.inputs, strict=True):
        if hasattr(socket, "default_value"):
            copied.default_value = socket.default_value
        for link in socket.links:
            if OVERLAY_KEY not in link.from_node:
                build.link(link.from_socket, copied)
    colour = twin.inputs["Base Color"]
    for link in list(colour.links):
        build.material.node_tree.links.remove(link)
    colour.default_value = (0.0, 0.0, 0.0, 1.0)
    return twin


def _numbered(name: str, index: int) -> str:
    return f"{name} {index + 1}" if index else name
