"""Materials of surfaces: a base that is lit as any material is, and its one socket of colour.

The base is a diffuse shader with a neutral gloss, or a user's own Principled shader (`adopting`). What
gives it its colour, and what comes after lighting, is put round it by `shading` and can be taken away again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from spectral_core.errors import BlenderError
from spectral_core.surfaces import Surface

from . import live
from .state import SURFACE_KEY

DIFFUSE = "Spectral Diffuse"
GLOSSY = "Spectral Gloss"
# Of a user's own material: the name of its Principled node.
PRINCIPLED_KEY = "spectral_booth_principled"
# The same, as JSON: node and socket that told the texture of its base colour where on the surface it is.
PLACE_KEY = "spectral_booth_place"
# Reflectance at normal incidence of the Fresnel node's IOR below; the gloss is relative to it.
_FRESNEL_IOR = 1.5
_FRESNEL_F0 = 0.04


def make_material(surface: Surface, forward: bool) -> bpy.types.Material:
    """A material for a surface, still without its colour.

    Forward shading keeps full precision; the deferred path stores colours in about 10 bits.
    """
    material = bpy.data.materials.new(surface.name)
    material[SURFACE_KEY] = surface.name
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.surface_render_method = "BLENDED" if forward else "DITHERED"
    material.use_transparency_overlap = False
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    output.location = (400, 0)
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.name = diffuse.label = DIFFUSE
    shader = diffuse.outputs[0]
    if surface.gloss > 0:
        shader = _add_gloss(material, shader, surface)
    links.new(shader, output.inputs["Surface"])
    return material


def colour_socket(material: bpy.types.Material) -> bpy.types.NodeSocket:
    """The socket of the base that takes the surface's colour.

    Raises
    ------
    BlenderError
        If a user removed or renamed the node.
    """
    name = str(material.get(PRINCIPLED_KEY, DIFFUSE))
    node = material.node_tree.nodes.get(name)
    if node is None:
        raise BlenderError(
            f"'{material.name}' has no node '{name}' any more",
            remedy="undo what removed or renamed it, or give its objects another material",
        )
    return node.inputs["Base Color" if PRINCIPLED_KEY in material else "Color"]


def output_of(tree: bpy.types.NodeTree, node: str, identifier: str) -> bpy.types.NodeSocket | None:
    """An output of a tree's node by names that were kept; None if a user removed or renamed it."""
    outputs = tree.nodes[node].outputs if node in tree.nodes else ()
    return next((each for each in outputs if each.identifier == identifier), None)


def base_shader(material: bpy.types.Material) -> bpy.types.NodeSocket:
    """The shader of the base: what the output shows unless something comes after lighting."""
    node = colour_socket(material).node
    if PRINCIPLED_KEY in material:
        return node.outputs[0]
    followers = [link.to_node for link in node.outputs[0].links if link.to_node.type == "ADD_SHADER"]
    return (followers[0] if followers else node).outputs[0]


def gloss_shader(material: bpy.types.Material) -> bpy.types.NodeSocket | None:
    """The gloss of a base of ours, None if it has none."""
    node = material.node_tree.nodes.get(GLOSSY)
    return None if node is None else node.outputs[0]


def has_gloss(material: bpy.types.Material) -> bool:
    """Whether the surface reflects anything but its colour."""
    return PRINCIPLED_KEY in material or GLOSSY in material.node_tree.nodes


def not_coded(material: bpy.types.Material) -> list[str]:
    """What coded lamps do not show of a user's own material."""
    if PRINCIPLED_KEY not in material:
        return []
    node = colour_socket(material).node
    found = []
    for name, neutral, what in (
        ("Alpha", 1.0, "is transparent: coded lamps show it solid"),
        ("Emission Strength", 0.0, "emits light of its own: coded lamps take it for a lamp's"),
        ("Transmission Weight", 0.0, "lets light through: coded lamps do not show that"),
        ("Subsurface Weight", 0.0, "scatters light inside: coded lamps take the radii of its channels for lights'"),
        ("Thin Film Thickness", 0.0, "has a thin film: coded lamps take its channels for lights"),
    ):
        socket = node.inputs.get(name)
        if socket is not None and (socket.links or socket.default_value != neutral):
            found.append(f"{material.name} {what}")
    for weight, tint in (("", "Specular Tint"), ("Coat Weight", "Coat Tint"), ("Sheen Weight", "Sheen Tint")):
        socket, part = node.inputs.get(tint), node.inputs.get(weight)
        there = part is None or part.links or part.default_value
        if there and socket is not None and (socket.links or len(set(socket.default_value[:3])) > 1):
            found.append(f"{material.name} has a {tint}: coded lamps take its channels for lights, use grey")
    return found


def output_node(material: bpy.types.Material) -> bpy.types.Node:
    """The output that Eevee renders: there may be others, for Cycles or to choose from.

    Raises
    ------
    BlenderError
        If there is none.
    """
    found = material.node_tree.get_output_node("EEVEE")
    if found is None:
        raise BlenderError(f"'{material.name}' has no output that Eevee renders", remedy="add a Material Output node")
    return found


def show(material: bpy.types.Material, shader: bpy.types.NodeSocket) -> None:
    """Link a shader to the output."""
    material.node_tree.links.new(shader, output_node(material).inputs["Surface"])


@contextmanager
def uniform(material: bpy.types.Material, value: float) -> Iterator[None]:
    """Show the base alone with a grey of `value` instead of the surface's colour; restored afterwards."""
    links = material.node_tree.links
    socket, output = colour_socket(material), output_node(material).inputs["Surface"]
    colour, shown = tuple(socket.default_value), output.links[0].from_socket
    sources = [link.from_socket for link in socket.links]
    for link in list(socket.links):
        links.remove(link)
    socket.default_value = (value, value, value, 1.0)
    show(material, base_shader(material))
    try:
        yield
    finally:
        socket.default_value = colour
        for source in sources:
            links.new(source, socket)
        show(material, shown)


def _add_gloss(material: bpy.types.Material, diffuse: bpy.types.NodeSocket, surface: Surface) -> bpy.types.NodeSocket:
    """Neutral gloss on top: Fresnel-weighted glossy light of the lamp's own colour."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    fresnel = nodes.new("ShaderNodeFresnel")
    fresnel.location = (-320, -240)
    fresnel.inputs["IOR"].default_value = _FRESNEL_IOR
    scale = nodes.new("ShaderNodeMath")
    scale.operation = "MULTIPLY"
    scale.location = (-140, -240)
    scale.inputs[1].default_value = surface.gloss / _FRESNEL_F0
    links.new(fresnel.outputs[0], scale.inputs[0])
    colour = nodes.new("ShaderNodeAttribute")
    colour.attribute_type, colour.attribute_name = "VIEW_LAYER", live.GLOSS
    colour.location = (-320, -420)
    tint = nodes.new("ShaderNodeVectorMath")
    tint.operation = "SCALE"
    tint.location = (-140, -420)
    links.new(colour.outputs["Vector"], tint.inputs[0])
    links.new(scale.outputs[0], tint.inputs["Scale"])
    glossy = nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.name = glossy.label = GLOSSY
    glossy.location = (40, -160)
    glossy.inputs["Roughness"].default_value = surface.roughness
    links.new(tint.outputs[0], glossy.inputs["Color"])
    total = nodes.new("ShaderNodeAddShader")
    total.location = (220, 0)
    links.new(diffuse, total.inputs[0])
    links.new(glossy.outputs[0], total.inputs[1])
    return total.outputs[0]
