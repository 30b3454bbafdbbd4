"""Bake a hyperspectral texture into images of this file."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from .common import reported

if TYPE_CHECKING:
    from spectral_core.baking import BakedArrays

KINDS = (
    ("FILE", "As the File Says", "Reflectance, radiance or counts, as the file says it"),
    ("reflectance", "Reflectance", "Share of the light that is reflected"),
    ("radiance", "Radiance", "Needs a white reference"),
    ("counts", "Counts", "A camera's numbers; need a white reference"),
)


class BakeTexture(bpy.types.Operator):
    """Compute the exact colours of a hyperspectral texture under lights, one new image each"""

    bl_idname = "spectral_booth.bake_texture"
    bl_label = "Bake Texture"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Texture", description="ENVI, spectral OpenEXR, TIFF, .npy, .npz, MATLAB, or a folder", subtype="FILE_PATH"
    )
    lights: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Lights", description="Names or files, separated by semicolons", default="D65"
    )
    kind: bpy.props.EnumProperty(name="Values", items=KINDS, default="FILE")  # type: ignore[valid-type]
    scale: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Scale", description="Stored value of reflectance 1; 0 if the file says it", min=0.0
    )
    white: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="White", description="Capture of a white reference", subtype="FILE_PATH"
    )
    dark: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Dark", description="Capture in darkness", subtype="FILE_PATH"
    )
    wavelengths: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Wavelengths", description="first:last:step in nm, if the file does not say them"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file first; then, in a window, one step at a time, so that Esc can stop it."""
        if not self.filepath:
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Bake: in the background or from a script all at once."""
        with reported(self) as outcome:
            self._start()
            if bpy.app.background or context.window is None or not self.options.is_invoke:
                self._finish(context)
                return outcome.status
            manager = context.window_manager
            self._timer = manager.event_timer_add(0.01, window=context.window)
            manager.progress_begin(0, 1)
            manager.modal_handler_add(self)
            outcome.status = {"RUNNING_MODAL"}
        return outcome.status

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """One strip per timer event; Esc stops, and no image is made."""
        if event.type == "ESC":
            self._end(context)
            self.report({"WARNING"}, "Bake cancelled; no image was made")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        with reported(self) as outcome:
            try:
                fraction = next(self._steps)
            except StopIteration as finished:
                self._store(finished.value)
            else:
                context.window_manager.progress_update(fraction)
                context.workspace.status_text_set(f"Baking {self._texture.name} ({fraction:.0%}). Esc cancels")
                return {"RUNNING_MODAL"}
        self._end(context)
        return outcome.status

    def _start(self) -> None:
        from spectral_core.baking import baking_steps
        from spectral_core.errors import TextureError
        from spectral_core.lights import Light
        from spectral_core.textures import Reading, open_texture

        if not self.filepath:
            raise TextureError("no texture was named", remedy="give a file")
        names = [name.strip() for name in self.lights.split(";") if name.strip()] or ["D65"]
        self._lights = [Light.load(name) for name in names]
        reading = Reading(
            kind=None if self.kind == "FILE" else self.kind,
            scale=self.scale or None,
            white=_path(self.white),
            dark=_path(self.dark),
            wavelengths=self.wavelengths or None,
        )
        self._texture = open_texture(bpy.path.abspath(self.filepath), reading)
        self._steps: Generator[float, None, BakedArrays] = baking_steps(self._texture, self._lights)

    def _finish(self, context: bpy.types.Context) -> None:
        manager = context.window_manager
        manager.progress_begin(0, 1)
        try:
            while True:
                manager.progress_update(next(self._steps))
        except StopIteration as finished:
            self._store(finished.value)
        finally:
            manager.progress_end()

    def _store(self, baked: BakedArrays) -> None:
        from ..bridge.images import new_image

        for light, pixels, clipped in zip(self._lights, baked.images, baked.clipped_fractions, strict=True):
            image = new_image(f"{self._texture.name} under {light.name}", pixels)
            outside = f"; {clipped:.1%} of it outside sRGB" if clipped else ""
            self.report({"INFO"}, f"Image '{image.name}' made{outside}")
        for warning in baked.warnings:
            self.report({"WARNING"}, warning)

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()  # no thread goes on
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)


def _path(text: str) -> Path | None:
    return Path(bpy.path.abspath(text)) if text else None
