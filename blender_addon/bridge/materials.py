"""Materials of surfaces: one colour or one image on a diffuse shader, and a neutral gloss."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.surfaces import Surface

from .images import write_image
from .state import SURFACE_KEY

DIFFUSE = "Spectral Diffuse"
IMAGE = "Spectral Image"
GLOSS = "Spectral Gloss"
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
    if surface.texture is not None:
        _add_image_node(material, surface, diffuse)
    return material


def set_colour(material: bpy.types.Material, rgb: Float64Array) -> int:
    """Give a material one linear RGB (3,), or an image of linear RGB (height, width, 3) from the top.

    Negative values do not exist in Blender's working space: they become 0. Returns how many
    colours (pixels) that changed.
    """
    kept = np.maximum(rgb, 0.0)
    clipped = int((rgb < 0).any(axis=-1).sum())
    if rgb.ndim == 1:
        socket = material.node_tree.nodes[DIFFUSE].inputs["Color"]
        socket.default_value = (*kept.tolist(), 1.0)
    else:
        write_image(material.node_tree.nodes[IMAGE].image, kept.astype(np.float32))
    return clipped


def stored_colour(material: bpy.types.Material) -> Float64Array:
    """What the material holds, in the precision it is stored in: (3,) or (height, width, 3)."""
    node = material.node_tree.nodes.get(IMAGE)
    if node is None:
        socket = material.node_tree.nodes[DIFFUSE].inputs["Color"]
        return np.array(socket.default_value[:3], dtype=np.float64)
    image = node.image
    pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3].astype(np.float64)


def has_gloss(material: bpy.types.Material) -> bool:
    """Whether the material has a neutral gloss on top."""
    return GLOSS in material.node_tree.nodes


def set_gloss_colour(material: bpy.types.Material, rgb: Float64Array) -> None:
    """Colour (3,) of the gloss relative to the lamps; white unless the light is in the materials."""
    if has_gloss(material):
        material.node_tree.nodes[GLOSS].inputs[0].default_value = rgb.tolist()


@contextmanager
def uniform(material: bpy.types.Material, value: float) -> Iterator[None]:
    """Show a grey of `value` under white gloss instead of the surface's colour; restored afterwards."""
    tree = material.node_tree
    socket = tree.nodes[DIFFUSE].inputs["Color"]
    sources = [link.from_socket for link in socket.links]
    colour = tuple(socket.default_value)
    gloss = np.array(tree.nodes[GLOSS].inputs[0].default_value) if has_gloss(material) else np.ones(3)
    for link in list(socket.links):
        tree.links.remove(link)
    socket.default_value = (value, value, value, 1.0)
    set_gloss_colour(material, np.ones(3))
    try:
        yield
    finally:
        socket.default_value = colour
        set_gloss_colour(material, gloss)
        for source in sources:
            tree.links.new(source, socket)


def _add_image_node(material: bpy.types.Material, surface: Surface, diffuse: bpy.types.Node) -> None:
    texture = surface.texture
    assert texture is not None
    image = bpy.data.images.new(
        f"{surface.name} (spectral)", texture.width, texture.height, float_buffer=True, is_data=True
    )
    image.use_half_precision = False
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.name = node.label = IMAGE
    node.location = (-320, 0)
    node.image = image
    material.node_tree.links.new(node.outputs["Color"], diffuse.inputs["Color"])


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
    glossy = nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.location = (40, -160)
    glossy.inputs["Roughness"].default_value = surface.roughness
    tint = nodes.new("ShaderNodeVectorMath")
    tint.name = tint.label = GLOSS
    tint.operation = "SCALE"
    tint.location = (-140, -420)
    tint.inputs[0].default_value = (1.0, 1.0, 1.0)
    links.new(scale.outputs[0], tint.inputs["Scale"])
    links.new(tint.outputs[0], glossy.inputs["Color"])
    total = nodes.new("ShaderNodeAddShader")
    total.location = (220, 0)
    links.new(diffuse, total.inputs[0])
    links.new(glossy.outputs[0], total.inputs[1])
    return total.outputs[0]
