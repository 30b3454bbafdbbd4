"""Build a scene from its description."""

from __future__ import annotations

import bpy

from .common import busy, reported

PRESETS = (
    ("booth", "Light Booth", "A viewing booth with lamps, a ColorChecker and painted objects"),
    ("colorchecker", "ColorChecker", "24 patches under one directional light, seen from above"),
)


class BuildScene(bpy.types.Operator):
    """Build a spectral scene as a new scene of this file; other scenes stay as they are"""

    bl_idname = "spectral_booth.build"
    bl_label = "Build Spectral Scene"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Description", description="A scene's TOML file; the preset if left empty", subtype="FILE_PATH"
    )
    preset: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Preset", description="A description that comes with Spectral Booth", items=PRESETS
    )
    calibrate: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Calibrate White", description="Scale the lamps to the luminance of the description", default=True
    )
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN", "SKIP_SAVE"})  # type: ignore[valid-type]

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """A preset builds at once; without one, ask for a file."""
        if self.properties.is_property_set("preset") or self.properties.is_property_set("filepath"):
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Build, and show the new scene in the window."""
        with reported(self) as outcome, busy(context):
            from spectral_core.scene import bundled_scene, load_scene

            from ..bridge.build import new_scene

            path = bpy.path.abspath(self.filepath) if self.filepath else bundled_scene(self.preset)
            scene = new_scene(load_scene(path), calibrate=self.calibrate)
            if context.window is not None:
                context.window.scene = scene
            self.report({"INFO"}, f"Built '{scene.name}' with {len(scene.objects)} objects")
        return outcome.status
