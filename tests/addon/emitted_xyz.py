"""Run by test_display_xyz in a process of its own, whose variable OCIO names an exported config.

A plane emits XYZ, one texel a pixel. What Blender makes of it through each display and view is saved beside them.

    python emitted_xyz.py FOLDER DISPLAY=VIEW...
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

from blender_addon.bridge.display import Display, shown_on
from blender_addon.bridge.render import render_linear, save_shown


def build(XYZ: np.ndarray) -> bpy.types.Scene:
    """The camera sees XYZ (height, width, 3), first row at the top, and nothing else."""
    height, width, _ = XYZ.shape
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.filter_size, scene.eevee.taa_render_samples = 0.0, 1
    image = bpy.data.images.new("XYZ", width, height, float_buffer=True, is_data=True)
    image.use_half_precision = False
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = XYZ[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    material = bpy.data.materials.new("XYZ")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.surface_render_method = "BLENDED"
    tree = material.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    emission = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    bpy.ops.mesh.primitive_plane_add(size=1)
    plane = bpy.context.object
    plane.scale = (width, height, 1)
    plane.data.materials.append(material)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", float(max(width, height)), (0, 0, 1)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def main(folder: Path, shown: list[str]) -> None:
    scene = build(np.load(folder / "XYZ.npy"))
    np.save(folder / "linear.npy", render_linear(scene).pixels)
    for each in shown:
        display, _, view = each.partition("=")
        with shown_on(scene, Display(display, view)):
            np.save(folder / f"{display}.npy", save_shown(scene, folder / "shown.png"))
    (folder / "version").write_text(bpy.app.version_string)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
