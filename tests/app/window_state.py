"""What a managed scene shows, as the scripts inside Blender record it."""

from __future__ import annotations

import bpy


def state(scene: bpy.types.Scene) -> dict[str, object]:
    """Light, level, and what lamps and materials carry."""
    shown = scene.spectral_booth
    colours: dict[str, list[float]] = {}
    for item in scene.objects:
        if item.type == "LIGHT":
            colours[item.name] = list(item.data.color)
        for slot in item.material_slots:
            for node in slot.material.node_tree.nodes:
                if node.type == "BSDF_DIFFUSE":
                    colours[slot.material.name] = list(node.inputs["Color"].default_value[:3])
                if node.type == "TEX_IMAGE":
                    # A few texels are enough to see which light an image is for.
                    colours[f"{slot.material.name} image"] = list(node.image.pixels[4096:4104])
    return {"light": shown.light, "level": shown.level, "colours": colours}
