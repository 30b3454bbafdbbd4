"""Panels about how a scene is lit and what its surfaces hold."""

from __future__ import annotations

import bpy

from .lines import draw_lines
from .panel import CATEGORY, ScenePanel


class _OfManagedScenes:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_parent_id = ScenePanel.bl_idname

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """In a managed scene."""
        return bool(context.scene.spectral_booth.is_managed)


class LampsPanel(_OfManagedScenes, bpy.types.Panel):
    """Coloured or coded lamps, where they are shown, lamps with lights of their own."""

    bl_idname = "SPECTRAL_BOOTH_PT_lamps"
    bl_label = "Lamps"
    bl_order = 1

    def draw(self, context: bpy.types.Context) -> None:
        """One row of choices each; what does not fit stands below."""
        state = context.scene.spectral_booth
        row = self.layout.row(align=True)
        for way, text in (("COLOURED", "Coloured"), ("CODED", "Coded")):
            row.operator("spectral_booth.set_way", text=text, depress=state.way == way).way = way
        if state.way == "CODED" and state.target != "HEADSET":
            row = self.layout.row(align=True)
            for target, text in (("WINDOW", "Window"), ("WIDE", "All Colours")):
                button = row.operator("spectral_booth.set_way", text=text, depress=state.target == target)
                button.way, button.target = "CODED", target
        row = self.layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("spectral_booth.set_lamp_light", text="Light of Selected Lamps…", icon="LIGHT_SPOT")
        if state.way_notes:
            draw_lines(self.layout.box(), context, state.way_notes.split("; "), "ERROR")


class SurfacesPanel(_OfManagedScenes, bpy.types.Panel):
    """What surfaces hold: colours for one light, or coefficients for all."""

    bl_idname = "SPECTRAL_BOOTH_PT_surfaces"
    bl_label = "Surfaces"
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        """The two choices, and how exact the basis is."""
        state = context.scene.spectral_booth
        row = self.layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("spectral_booth.bake_colours", text="Baked", depress=state.basis is None)
        button = row.operator("spectral_booth.encode", text="Live", depress=state.basis is not None)
        button.tolerance, button.half = state.tolerance, state.half
        column = self.layout.column()
        column.prop(state, "tolerance")
        column.prop(state, "half")
        if state.basis is not None:
            draw_lines(self.layout.box(), context, state.basis_notes.split("; "), "INFO")
        if state.texture_notes:
            draw_lines(self.layout.box(), context, state.texture_notes.split("; "), "INFO")


class MaterialPanel(bpy.types.Panel):
    """A measured surface for a material of the user's own, beside Blender's settings of it."""

    bl_idname = "SPECTRAL_BOOTH_PT_material"
    bl_label = "Spectral Booth"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Where there is a material."""
        return getattr(context, "material", None) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Adopt or release."""
        material = context.material
        if "spectral_booth_principled" in material:
            self.layout.label(text=f"Shows the surface '{material['spectral_booth_surface']}'", icon="SHADING_RENDERED")
            self.layout.operator("spectral_booth.release", icon="X").materials = material.name
        elif "spectral_booth_surface" in material:
            self.layout.label(text="Made by Spectral Booth", icon="SHADING_RENDERED")
        else:
            self.layout.operator_context = "INVOKE_DEFAULT"
            button = self.layout.operator("spectral_booth.adopt", text="Show Measured Surface…", icon="FILEBROWSER")
            button.materials, button.filepath = material.name, ""


_classes = (LampsPanel, SurfacesPanel, MaterialPanel)


def register() -> None:
    """Add the panels."""
    for each in _classes:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Remove them again."""
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
