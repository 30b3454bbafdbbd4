"""Properties that a managed scene keeps in the .blend."""

from __future__ import annotations

import bpy

LEVEL_ITEMS = (
    ("0", "0 Unmanaged", "RGB materials under white lamps, as in any RGB pipeline"),
    ("1", "1 Lamps", "RGB materials under lamps of the light's colour"),
    ("2", "2 Spectral", "Exact colours of the measured surfaces under the light"),
)

WAY_ITEMS = (
    (
        "COLOURED",
        "Coloured Lamps",
        "Lamps carry their colour: works with everything in Blender, exact where all lamps have the same light",
    ),
    (
        "CODED",
        "Coded Lamps",
        "Lamps carry channels: up to three lights mix exactly, no colour is lost; direct light and gloss only",
    ),
)
TARGET_ITEMS = (
    ("WINDOW", "Window", "Linear Rec.709 for Blender's own views; colours outside it are clipped"),
    ("WIDE", "Window, All Colours", "XYZ for the view of an exported OpenColorIO config; coded lamps only"),
    ("HEADSET", "Headset", "What makes a headset show the codes of its profile"),
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
    way: bpy.props.EnumProperty(name="Lamps", items=WAY_ITEMS, default="COLOURED")  # type: ignore[valid-type]
    target: bpy.props.EnumProperty(name="Target", items=TARGET_ITEMS, default="WINDOW")  # type: ignore[valid-type]
    basis: bpy.props.PointerProperty(type=bpy.types.Text, name="Spectral basis")  # type: ignore[valid-type]
    basis_tolerance: bpy.props.FloatProperty(name="Tolerance of the basis")  # type: ignore[valid-type]
    basis_half: bpy.props.BoolProperty(name="Half floats in its images")  # type: ignore[valid-type]
    basis_error: bpy.props.FloatProperty(name="Its largest dE00")  # type: ignore[valid-type]
    basis_notes: bpy.props.StringProperty(name="Notes about the basis")  # type: ignore[valid-type]
    texture_notes: bpy.props.StringProperty(name="Notes about its textures")  # type: ignore[valid-type]
    # What the panel asks for next; those above tell of the basis that there is.
    tolerance: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Tolerance, dE00", description="Largest error of any surface and pixel under any light of the scene",
        min=0.001, soft_min=0.01, soft_max=2.0, default=0.1, precision=3,
    )  # fmt: skip
    half: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Half Floats", description="Half the memory on the graphics card; errors are measured as stored"
    )
    # The view that the window had before it showed XYZ.
    window_view: bpy.props.StringProperty(name="View of the window")  # type: ignore[valid-type]
    way_notes: bpy.props.StringProperty(name="Notes about the lamps")  # type: ignore[valid-type]
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
