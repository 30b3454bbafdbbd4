"""Show a scene through a display's profile in its materials, for the headset."""

from __future__ import annotations

import bpy

from .common import ManagedScene, reported


class SetDisplay(ManagedScene, bpy.types.Operator):
    """Let every spectral material compute the device codes of a measured headset, each eye by its own profile"""

    bl_idname = "spectral_booth.set_display"
    bl_label = "Show in Headset"
    bl_options = {"REGISTER", "UNDO"}

    left: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Left or Both", description="A profile's JSON, or htc-vive-2020, htc-vive-2021, sRGB", subtype="FILE_PATH"
    )
    right: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Right", description="The right eye's profile, if it has its own", subtype="FILE_PATH"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the profiles if none was given."""
        if self.left:
            return self.execute(context)
        state = context.scene.spectral_booth
        self.left, self.right = state.display_left, state.display_right
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Show")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Put the display into the materials."""
        with reported(self) as outcome:
            from ..bridge import ways

            for note in ways.show_in_headset(context.scene, self.left, self.right).notes:
                self.report({"INFO"}, note)
        return outcome.status


class AddDisplayGroup(bpy.types.Operator):
    """Add a profile's node group, XYZ in and emission for the headset out, to use in materials of your own"""

    bl_idname = "spectral_booth.add_display_group"
    bl_label = "Add Display Node Group"
    bl_options = {"REGISTER", "UNDO"}

    profile: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Profile", description="A profile's JSON, or htc-vive-2020, htc-vive-2021, sRGB", subtype="FILE_PATH"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the profile if none was given."""
        if self.profile:
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Add")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make the group; it is kept in the file although nothing uses it yet."""
        with reported(self) as outcome:
            from spectral_core.display import load_profile

            from ..bridge.display_nodes import display_group

            profile = load_profile(bpy.path.abspath(self.profile))
            tree = display_group(profile, f"Display {profile.name}")
            tree.use_fake_user = True
            self.report({"INFO"}, f"Node group '{tree.name}' added: Shader Editor, Add, Group")
        return outcome.status


class ClearDisplay(ManagedScene, bpy.types.Operator):
    """Show the scene's own colours again, as windows and renders need them"""

    bl_idname = "spectral_booth.clear_display"
    bl_label = "Show in Window"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Take the display out of the materials."""
        with reported(self) as outcome:
            from ..bridge import ways

            ways.show_in_window(context.scene)
        return outcome.status
