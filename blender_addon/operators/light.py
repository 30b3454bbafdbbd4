"""Choose the light and the level of a scene, calibrate its white."""

from __future__ import annotations

import bpy

from .common import ManagedScene, busy, reported


def scene_lights(operator: object, context: bpy.types.Context, text: str) -> list[str]:
    """Names of the scene's lights that contain a text, to choose from."""
    return [each.name for each in context.scene.spectral_booth.lights if text.casefold() in each.name.casefold()]


class SetLight(ManagedScene, bpy.types.Operator):
    """Show the scene under a light: one of its own, a built-in one or a file"""

    bl_idname = "spectral_booth.set_light"
    bl_label = "Set Light"
    bl_options = {"REGISTER", "UNDO"}

    light: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Light", description="Built-in name or file", search=scene_lights, search_options={"SORT", "SUGGESTION"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the light if none was given."""
        if self.light:
            return self.execute(context)
        self.light = context.scene.spectral_booth.light
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set lamps and materials."""
        return _apply(self, context, self.light, int(context.scene.spectral_booth.level))


class SetLevel(ManagedScene, bpy.types.Operator):
    """Choose how much of the scene is spectral: 0 nothing, 1 the lamps, 2 lamps and surfaces"""

    bl_idname = "spectral_booth.set_level"
    bl_label = "Set Level"
    bl_options = {"REGISTER", "UNDO"}

    level: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Level",
        description="0 RGB under white lamps, 1 RGB under lamps of the light's colour, 2 exact colours",
        min=0,
        max=2,
        default=2,
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set lamps and materials."""
        return _apply(self, context, context.scene.spectral_booth.light, self.level)


class CalibrateWhite(ManagedScene, bpy.types.Operator):
    """Measure the white target in a render and scale all lamps to the luminance it shall have"""

    bl_idname = "spectral_booth.calibrate_white"
    bl_label = "Calibrate White"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Render, scale the lamps, render once more to confirm."""
        with reported(self) as outcome, busy(context):
            from ..bridge.lighting import calibrate_white

            done = calibrate_white(context.scene)
            self.report({"INFO"}, f"White luminance {done.before:.4g} before, {done.after:.4g} now")
        return outcome.status


def _apply(operator: bpy.types.Operator, context: bpy.types.Context, light: str, level: int) -> set[str]:
    with reported(operator) as outcome:
        from ..bridge.ways import light as show

        for note in show(context.scene, light, level).lighting.notes:
            operator.report({"INFO"}, note)
    return outcome.status
