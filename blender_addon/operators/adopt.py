"""Let a user's own materials show measured surfaces, and give them back."""

from __future__ import annotations

from pathlib import Path

import bpy

from .common import busy, reported
from .textures import KINDS


class AdoptMaterials(bpy.types.Operator):
    """Give Principled materials a measured surface as base colour; all else of them stays as it is"""

    bl_idname = "spectral_booth.adopt"
    bl_label = "Adopt Materials"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Surface", description="Hyperspectral texture, or a table of reflectances", subtype="FILE_PATH"
    )
    spectrum: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Spectrum", description="Which one of a table of reflectances"
    )
    materials: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Materials", description="Names separated by semicolons; the active one of the active object if empty"
    )
    kind: bpy.props.EnumProperty(name="Values", items=KINDS, default="FILE")  # type: ignore[valid-type]
    scale: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Scale", description="Stored value of reflectance 1; 0 if the file says it", min=0.0
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file if none was given."""
        if self.filepath:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Put the surface into the materials."""
        with reported(self) as outcome, busy(context):
            from ..bridge import adopting

            for note in adopting.adopt(context.scene, chosen(context, self.materials), self._source()):
                self.report({"WARNING"}, note)
        return outcome.status

    def _source(self) -> object:
        from spectral_core.errors import BlenderError

        from ..bridge.adopting import Source

        if not self.filepath:
            raise BlenderError("no surface was named", remedy="give a hyperspectral texture or a table of reflectances")
        path = bpy.path.abspath(self.filepath)
        keys: dict[str, str | float | bool] = {"texture": path}
        if Path(path).suffix.lower() in (".csv", ".txt", ".tsv"):
            keys = {"file": path} | ({"spectrum": self.spectrum} if self.spectrum else {})
        else:
            keys |= {} if self.kind == "FILE" else {"kind": self.kind}
            keys |= {"scale": self.scale} if self.scale else {}
        return Source(keys)


class ReleaseMaterials(bpy.types.Operator):
    """Give adopted materials back, node for node as they were"""

    bl_idname = "spectral_booth.release"
    bl_label = "Release Materials"
    bl_options = {"REGISTER", "UNDO"}

    materials: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Materials", description="Names separated by semicolons; all adopted ones if empty"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only in a scene that has some; says so otherwise."""
        if context.scene is not None and context.scene.spectral_booth.is_managed:
            return True
        cls.poll_message_set("This scene has no adopted materials")
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Take the surface out of the materials."""
        with reported(self) as outcome:
            from ..bridge import adopting

            scene = context.scene
            wanted = chosen(context, self.materials) if self.materials else adopting.adopted(scene)
            for note in adopting.release(scene, wanted):
                self.report({"WARNING"}, note)
        return outcome.status


def chosen(context: bpy.types.Context, names: str) -> list[bpy.types.Material]:
    """Materials by name, or the active one."""
    from spectral_core.errors import BlenderError

    if not names.strip():
        item = context.object
        return [item.active_material] if item is not None and item.active_material is not None else []
    found = []
    for name in [each.strip() for each in names.split(";") if each.strip()]:
        if name not in bpy.data.materials:
            raise BlenderError(f"no material is called '{name}'", remedy="name materials of this file")
        found.append(bpy.data.materials[name])
    return found
