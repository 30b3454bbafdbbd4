"""Bake a hyperspectral texture into images of this file."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from .common import Stepped

if TYPE_CHECKING:
    from spectral_core.baking import BakedArrays

KINDS = (
    ("FILE", "As the File Says", "Reflectance, radiance or counts, as the file says it"),
    ("reflectance", "Reflectance", "Share of the light that is reflected"),
    ("radiance", "Radiance", "Needs a white reference"),
    ("counts", "Counts", "A camera's numbers; need a white reference"),
)


class BakeTexture(Stepped, bpy.types.Operator):
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

    stopped_text = "Bake cancelled; no image was made"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file if none was given."""
        if self.filepath:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """In a window, when a user asks for it, in steps; from a script all at once."""
        in_window = not bpy.app.background and context.window is not None and self.options.is_invoke
        return self.run_in_steps(context) if in_window else self.run_at_once(context)

    def _progress(self, step: float) -> tuple[float, str]:
        return step, f"Baking {self._texture.name}"

    def _start(self, context: bpy.types.Context) -> Generator[float, None, BakedArrays]:
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
        return baking_steps(self._texture, self._lights)

    def _store(self, context: bpy.types.Context, result: BakedArrays) -> None:
        from ..bridge.images import new_image

        for light, pixels, clipped in zip(self._lights, result.images, result.clipped_fractions, strict=True):
            image = new_image(f"{self._texture.name} under {light.name}", pixels)
            outside = f"; {clipped:.1%} of it outside sRGB" if clipped else ""
            self.report({"INFO"}, f"Image '{image.name}' made{outside}")
        for warning in result.warnings:
            self.report({"WARNING"}, warning)


def _path(text: str) -> Path | None:
    return Path(bpy.path.abspath(text)) if text else None
