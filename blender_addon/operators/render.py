"""Render a scene to a picture."""

from __future__ import annotations

from pathlib import Path

import bpy

from .common import ManagedScene, busy, reported


class RenderScene(ManagedScene, bpy.types.Operator):
    """Render the scene as it is lit now to a PNG"""

    bl_idname = "spectral_booth.render"
    bl_label = "Render to PNG…"
    bl_options = {"REGISTER"}

    filepath: bpy.props.StringProperty(name="Picture", subtype="FILE_PATH")  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.png", options={"HIDDEN", "SKIP_SAVE"})  # type: ignore[valid-type]

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask where to write; the name says light and level."""
        state = context.scene.spectral_booth
        self.filepath = bpy.path.clean_name(f"{context.scene.name}_{state.light}_level{state.level}") + ".png"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Render."""
        with reported(self) as outcome, busy(context):
            from spectral_core.errors import OutputError

            from ..bridge.render import render_png

            if not self.filepath:
                raise OutputError("no picture was named", remedy="give a file name")
            path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".png"))
            seconds = render_png(context.scene, path)
            self.report({"INFO"}, f"Rendered {path} in {seconds:.1f} s")
        return outcome.status
