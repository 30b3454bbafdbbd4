"""Properties that a managed scene keeps in the .blend."""

from __future__ import annotations

import bpy

LEVEL_ITEMS = (
    ("0", "0 Unmanaged", "RGB materials under white lamps, as in any RGB pipeline"),
    ("1", "1 Lamps", "RGB materials under lamps of the light's colour"),
    ("2", "2 Spectral", "Exact colours of the measured surfaces under the light"),
)


class SpectralBoothLight(bpy.types.PropertyGroup):
    """One light that a scene offers; its `name` is a built-in name or a file."""


class SpectralBoothScene(bpy.types.PropertyGroup):
    """State of a managed scene; empty in all others.

    Set light and level through the operators: they change lamps and materials, these record it.
    """

    description: bpy.props.PointerProperty(type=bpy.types.Text, name="Description")  # type: ignore[valid-type]
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH")  # type: ignore[valid-type]
    lights: bpy.props.CollectionProperty(type=SpectralBoothLight, name="Lights")  # type: ignore[valid-type]
    light: bpy.props.StringProperty(name="Light", default="D65")  # type: ignore[valid-type]
    level: bpy.props.EnumProperty(name="Level", items=LEVEL_ITEMS, default="2")  # type: ignore[valid-type]
    notes: bpy.props.StringProperty(name="Notes")  # type: ignore[valid-type]
    result: bpy.props.StringProperty(name="Last result")  # type: ignore[valid-type]
    display_left: bpy.props.StringProperty(name="Display, left or both eyes")  # type: ignore[valid-type]
    display_right: bpy.props.StringProperty(name="Display, right eye")  # type: ignore[valid-type]
    display_notes: bpy.props.StringProperty(name="Display notes")  # type: ignore[valid-type]

    @property
    def is_managed(self) -> bool:
        """Whether this add-on built the scene."""
        return self.description is not None


_classes = (SpectralBoothLight, SpectralBoothScene)


def register() -> None:
    """Add the scene's properties."""
    for each in _classes:
        bpy.utils.register_class(each)
    bpy.types.Scene.spectral_booth = bpy.props.PointerProperty(type=SpectralBoothScene)
    # What the patch player shows now; belongs to the window, never to a file.
    bpy.types.WindowManager.spectral_booth_player = bpy.props.StringProperty(options={"SKIP_SAVE"})


def unregister() -> None:
    """Remove them again; the data stays in saved files."""
    del bpy.types.WindowManager.spectral_booth_player
    del bpy.types.Scene.spectral_booth
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
