"""Properties that a managed scene keeps in the .blend."""

from __future__ import annotations

import bpy

LEVEL_ITEMS = (
    ("0", "0 Unmanaged", "RGB materials under white lamps, as in any RGB pipeline"),
    ("1", "1 Lamps", "RGB materials under lamps of the light's colour"),
    ("2", "2 Spectral", "Exact colours of the measured surfaces under the light"),
)


class SpectralBoothScene(bpy.types.PropertyGroup):
    """State of a managed scene; empty in all others."""

    description: bpy.props.PointerProperty(type=bpy.types.Text, name="Description")  # type: ignore[valid-type]
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH")  # type: ignore[valid-type]
    light: bpy.props.StringProperty(name="Light", default="D65")  # type: ignore[valid-type]
    level: bpy.props.EnumProperty(name="Level", items=LEVEL_ITEMS, default="2")  # type: ignore[valid-type]
    notes: bpy.props.StringProperty(name="Notes")  # type: ignore[valid-type]
    result: bpy.props.StringProperty(name="Last result")  # type: ignore[valid-type]


def register() -> None:
    """Add the scene's properties."""
    bpy.utils.register_class(SpectralBoothScene)
    bpy.types.Scene.spectral_booth = bpy.props.PointerProperty(type=SpectralBoothScene)


def unregister() -> None:
    """Remove them again; the data stays in saved files."""
    del bpy.types.Scene.spectral_booth
    bpy.utils.unregister_class(SpectralBoothScene)
