"""Read surfaces off a render: which pixels show which object, and how much light falls there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from spectral_core.arrays import BoolArray, Float32Array, Float64Array

from . import live, materials, state
from .render import render_linear

# The reconstruction filter is 1.5 pixels wide: two pixels from an edge nothing else is mixed in.
_BORDER_PIXELS = 2


@dataclass(frozen=True)
class Identity:
    """Which object and which point of its texture each pixel shows.

    Attributes
    ----------
    masks
        Pixels (height, width) wholly inside each managed object, by object name.
    uv
        (height, width, 2) texture coordinates, v up.
    """

    masks: dict[str, BoolArray]
    uv: Float32Array


@dataclass(frozen=True)
class Illumination:
    """Light on each pixel's surface (height, width), by an all-white render under neutral lamps.

    Attributes
    ----------
    irradiance
        Relative to that which gives the perfect diffuser its luminance.
    gloss
        Light that neutral gloss adds, in the same unit.
    """

    irradiance: Float32Array
    gloss: Float32Array


def identify(scene: bpy.types.Scene) -> Identity:
    """Render which object each pixel shows."""
    items = list(state.managed_objects(scene))
    with _all_emit_identity(scene):
        for index, item in enumerate(items):
            item.pass_index = index + 1
        pixels = render_linear(scene).pixels
    numbers = np.round(pixels[..., 2]).astype(int)
    masks = {item.name: _eroded(numbers == index + 1) for index, item in enumerate(items)}
    return Identity(masks, pixels[..., :2])


def illumination(scene: bpy.types.Scene, within: BoolArray | None = None) -> Illumination:
    """Render the irradiance, and the gloss if the scene has some; with `within` only round those pixels."""
    with _cropped(scene, within):
        with _neutral(scene, 1.0):
            white = render_linear(scene).pixels[..., 1]
        if not any(map(materials.has_gloss, state.all_managed_materials(scene))):
            return Illumination(white, np.zeros_like(white))
        with _neutral(scene, 0.0):
            gloss = render_linear(scene).pixels[..., 1]
    return Illumination(white - gloss, gloss)


def sample(image: Float64Array, uv: Float32Array) -> Float64Array:
    """Bilinear samples (n, 3) of an image (height, width, 3) from the top, at uv (n, 2), repeating:
    texel centres lie at half texels, as on a GPU.
    """
    height, width, _ = image.shape
    x = uv[:, 0].astype(np.float64) * width - 0.5
    y = (1.0 - uv[:, 1].astype(np.float64)) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    columns, rows = (left % width, (left + 1) % width), (top % height, (top + 1) % height)
    upper = image[rows[0], columns[0]] * (1 - fx) + image[rows[0], columns[1]] * fx
    lower = image[rows[1], columns[0]] * (1 - fx) + image[rows[1], columns[1]] * fx
    return np.asarray(upper * (1 - fy) + lower * fy)


@contextmanager
def _neutral(scene: bpy.types.Scene, value: float) -> Iterator[None]:
    """All surfaces of one grey, all lamps of unit colour; restored afterwards."""
    colours = [(lamp.data, tuple(lamp.data.color)) for lamp in state.managed_lamps(scene)]
    with ExitStack() as stack:
        stack.enter_context(live.white_gloss(scene))
        for material in state.all_managed_materials(scene):
            stack.enter_context(materials.uniform(material, value))
        for data, _ in colours:
            data.color = (1.0, 1.0, 1.0)
        try:
            yield
        finally:
            for data, colour in colours:
                data.color = colour


@contextmanager
def _cropped(scene: bpy.types.Scene, within: BoolArray | None) -> Iterator[None]:
    """Render only the rectangle round `within` (height, width); the rest of the image is black."""
    if within is None:
        yield
        return
    render = scene.render
    kept = (render.use_border, render.use_crop_to_border, render.border_min_x, render.border_max_x,
            render.border_min_y, render.border_max_y)  # fmt: skip
    height, width = within.shape
    rows, columns = np.flatnonzero(within.any(axis=1)), np.flatnonzero(within.any(axis=0))
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x = columns[0] / width, (columns[-1] + 1) / width
    render.border_min_y, render.border_max_y = 1 - (rows[-1] + 1) / height, 1 - rows[0] / height
    try:
        yield
    finally:
        (render.use_border, render.use_crop_to_border, render.border_min_x, render.border_max_x,
         render.border_min_y, render.border_max_y) = kept  # fmt: skip


@contextmanager
def _all_emit_identity(scene: bpy.types.Scene) -> Iterator[None]:
    """Every surface emits (u, v, object number), one unfiltered sample a pixel.

    The slots are exchanged one by one: Eevee knows no material override before 5.0.
    """
    material = _identity_material()
    shown = [item for item in scene.objects if hasattr(item.data, "materials")]
    bare = {item.data for item in shown if not item.data.materials}
    for data in bare:
        data.materials.append(None)
    # All are read before the first is set, because objects may share their data.
    slots = [(slot, slot.material) for item in shown for slot in item.material_slots]
    kept = (scene.eevee.taa_render_samples, scene.render.filter_size)
    scene.eevee.taa_render_samples, scene.render.filter_size = 1, 0.0
    for slot, _ in slots:
        slot.material = material
    try:
        yield
    finally:
        for slot, before in slots:
            slot.material = before
        for data in bare:
            data.materials.clear()
        scene.eevee.taa_render_samples, scene.render.filter_size = kept
        bpy.data.materials.remove(material)


def _identity_material() -> bpy.types.Material:
    material = bpy.data.materials.new("Spectral Booth identity")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    coordinates = nodes.new("ShaderNodeTexCoord")
    split = nodes.new("ShaderNodeSeparateXYZ")
    links.new(coordinates.outputs["UV"], split.inputs[0])
    number = nodes.new("ShaderNodeObjectInfo")
    colour = nodes.new("ShaderNodeCombineColor")
    links.new(split.outputs[0], colour.inputs[0])
    links.new(split.outputs[1], colour.inputs[1])
    links.new(number.outputs["Object Index"], colour.inputs[2])
    emission = nodes.new("ShaderNodeEmission")
    links.new(colour.outputs[0], emission.inputs["Color"])
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def _eroded(mask: BoolArray) -> BoolArray:
    """The mask without its border, image edges included."""
    padded = np.pad(mask, _BORDER_PIXELS)
    result = mask.copy()
    height, width = mask.shape
    for dy in range(2 * _BORDER_PIXELS + 1):
        for dx in range(2 * _BORDER_PIXELS + 1):
            result &= padded[dy : dy + height, dx : dx + width]
    return result
