"""Panel in the 3D view's sidebar. It draws what the scene remembers and computes nothing."""

from __future__ import annotations

import textwrap

import bpy

CATEGORY = "Spectral Booth"
# Mean width of a character of the interface's font, at a scale of 1.
_CHARACTER_PIXELS = 7.0
# Borders of a box on both sides, and of an icon before the text.
_BOX_PIXELS = 60.0


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
                _draw_lines(self.layout.box(), context, state.display_notes.split("; "), "INFO")
        playing = context.window_manager.spectral_booth_player
        row = self.layout.row()
        row.enabled = not playing
        row.operator("spectral_booth.play_patches", text="Play Patches…", icon="PLAY")
        if playing:
            _draw_lines(self.layout.box(), context, [playing, "Esc stops"], "RENDER_ANIMATION")


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
        _draw_lines(layout.box(), context, state.notes.split("; "), "INFO")
    column = layout.column(align=True)
    column.operator("spectral_booth.calibrate_white", icon="LIGHT_SUN")
    column.operator("spectral_booth.render", icon="RENDER_STILL")
    row = column.row(align=True)
    row.operator("spectral_booth.verify", text="Verify Light", icon="CHECKMARK").lights = "CURRENT"
    row.operator("spectral_booth.verify", text="Verify All").lights = "ALL"
    if state.result:
        _draw_lines(layout.box(), context, state.result.split("\n"), "CHECKMARK")


def _draw_lines(layout: bpy.types.UILayout, context: bpy.types.Context, lines: list[str], icon: str) -> None:
    """Lines of text broken to the sidebar's width; the first has the icon."""
    scale = context.preferences.system.ui_scale
    width = max(16, int((context.region.width / scale - _BOX_PIXELS) / _CHARACTER_PIXELS))
    column = layout.column(align=True)
    column.scale_y = 0.85
    for number, line in enumerate(part for each in lines for part in textwrap.wrap(each, width)):
        column.label(text=line, icon="BLANK1" if number else icon)


_classes = (LightMenu, ScenePanel, DisplayPanel, BuildPanel)


def register() -> None:
    """Add the menu and the panels."""
    for each in _classes:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Remove them again."""
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
