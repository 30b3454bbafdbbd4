"""Entries in Blender's own menus; what stands in no menu is not found by its search either."""

from __future__ import annotations

import bpy


def register() -> None:
    """Add them."""
    bpy.types.IMAGE_MT_image.append(_draw_bake)


def unregister() -> None:
    """Take them back."""
    bpy.types.IMAGE_MT_image.remove(_draw_bake)


def _draw_bake(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator("spectral_booth.bake_texture", text="Bake Hyperspectral Texture…", icon="IMAGE_DATA")
