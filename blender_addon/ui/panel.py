"""Panel in the 3D view's sidebar. It draws what the scene remembers and computes nothing."""

from __future__ import annotations

import bpy

from .lines import draw_lines

CATEGORY = "Spectral Booth"


class LightMenu(bpy.types.Menu):
    """The lights of the scene."""

    bl_idname = "SPECTRAL_BOOTH_MT_light"
    bl_label = "Light"

    def draw(self, context: bpy.types.Context) -> None:
        """One entry per light; the current one is marked."""
        state = context.scene.spectral_booth
        for each in state.lights:
            icon = "RADIOBUT_ON" if each.name == state.light else "RADIOBUT_OFF"
            self.layout.operator("spectral_booth.set_light", text=each.name, icon=icon).light = each.name
        self.layout.separator()
        self.layout.operator_context = "INVOKE_DEFAULT"
        self.layout.operator("spectral_booth.set_light", text="Other…", icon="FILEBROWSER").light = ""
        self.layout.operator("spectral_booth.set_mixture", text="Mixture…", icon="NODE_COMPOSITING").light_1 = ""


class ScenePanel(bpy.types.Panel):
    """Build a spectral scene, choose its light and level, verify it."""

    bl_idname = "SPECTRAL_BOOTH_PT_scene"
    bl_label = "Spectral Booth"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY

    def draw(self, context: bpy.types.Context) -> None:
        """Build buttons in an unmanaged scene, the controls in a managed one."""
        if context.scene.spectral_booth.is_managed:
            _draw_controls(self.layout, context)
        else:
            _draw_build(self.layout)


class BuildPanel(bpy.types.Panel):
    """Build one more scene in this file."""

    bl_idname = "SPECTRAL_BOOTH_PT_build"
    bl_label = "Build Another Scene"
    bl_order = 4
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_parent_id = ScenePanel.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """In a managed scene; elsewhere the buttons stand at the top."""
        return bool(context.scene.spectral_booth.is_managed)

    def draw(self, context: bpy.types.Context) -> None:
        """The same buttons as in an unmanaged scene."""
        _draw_build(self.layout)


class DisplayPanel(bpy.types.Panel):
    """Measure the display: screen or headset."""

    bl_idname = "SPECTRAL_BOOTH_PT_display"
    bl_label = "Display"
    bl_order = 3
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_parent_id = ScenePanel.bl_idname

    def draw(self, context: bpy.types.Context) -> None:
        """The headset's profile, the player's button, and what it shows while it plays."""
        state = context.scene.spectral_booth
        if state.is_managed:
            row = self.layout.row(align=True)
            row.operator_context = "INVOKE_DEFAULT"
            row.operator("spectral_booth.set_display", text="Headset Profile…", icon="VIEW_CAMERA").left = ""
            if state.display_left:
                row.operator("spectral_booth.clear_display", text="", icon="X")
                draw_lines(self.layout.box(), context, state.display_notes.split("; "), "INFO")
        playing = context.window_manager.spectral_booth_player
        row = self.layout.row()
        row.enabled = not playing
        row.operator("spectral_booth.play_patches", text="Play Patches…", icon="PLAY")
        if playing:
            draw_lines(self.layout.box(), context, [playing, "Esc stops"], "RENDER_ANIMATION")


def _draw_build(layout: bpy.types.UILayout) -> None:
    column = layout.column(align=True)
    column.scale_y = 1.2
    column.operator("spectral_booth.build", text="Light Booth", icon="OUTLINER_OB_LIGHT").preset = "booth"
    column.operator("spectral_booth.build", text="ColorChecker", icon="MESH_GRID").preset = "colorchecker"
    layout.operator("spectral_booth.build", text="From Description…", icon="FILEBROWSER")


def _draw_controls(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    state = context.scene.spectral_booth
    column = layout.column(align=True)
    column.label(text="Light", icon="LIGHT")
    column.menu(LightMenu.bl_idname, text=state.light)
    column = layout.column(align=True)
    column.label(text="Level", icon="COLOR")
    row = column.row(align=True)
    for level, text in enumerate(("Unmanaged", "Lamps", "Spectral")):
        chosen = state.level == str(level)
        row.operator("spectral_booth.set_level", text=text, depress=chosen).level = level
    if state.notes:
        draw_lines(layout.box(), context, state.notes.split("; "), "INFO")
    column = layout.column(align=True)
    column.operator("spectral_booth.calibrate_white", icon="LIGHT_SUN")
    column.operator("spectral_booth.render", icon="RENDER_STILL")
    row = column.row(align=True)
    row.operator("spectral_booth.verify", text="Verify Light", icon="CHECKMARK").lights = "CURRENT"
    row.operator("spectral_booth.verify", text="Verify All").lights = "ALL"
    if state.result:
        draw_lines(layout.box(), context, state.result.split("\n"), "CHECKMARK")


_classes = (LightMenu, ScenePanel, DisplayPanel, BuildPanel)


def register() -> None:
    """Add the menu and the panels."""
    for each in _classes:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Remove them again."""
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
