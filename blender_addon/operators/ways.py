"""How a scene is lit: coloured or coded lamps, live or baked surfaces, mixtures, lamps with lights of their own."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING

import bpy

from ..props import TARGET_ITEMS, WAY_ITEMS
from .common import ManagedScene, Stepped, reported
from .light import scene_lights

if TYPE_CHECKING:
    from ..bridge.encoded import Encoding


class SetWay(ManagedScene, bpy.types.Operator):
    """Light the scene by coloured or by coded lamps, and back: nothing is lost either way"""

    bl_idname = "spectral_booth.set_way"
    bl_label = "Set Lamps"
    bl_options = {"REGISTER", "UNDO"}

    way: bpy.props.EnumProperty(name="Lamps", items=WAY_ITEMS)  # type: ignore[valid-type]
    target: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Target", items=(("KEEP", "As It Is", "Where the scene is shown now"), *TARGET_ITEMS), default="KEEP"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make all materials anew."""
        with reported(self) as outcome:
            from ..bridge import ways

            for note in ways.set_way(context.scene, self.way, None if self.target == "KEEP" else self.target):
                self.report({"WARNING"}, note)
        return outcome.status


class Encode(ManagedScene, Stepped, bpy.types.Operator):
    """Encode all surfaces in a spectral basis: then a change of light touches no material, image or shader"""

    bl_idname = "spectral_booth.encode"
    bl_label = "Make Light Live"
    bl_options = {"REGISTER", "UNDO"}

    tolerance: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Tolerance, dE00", description="Largest error of any surface and pixel under any light of the scene",
        min=0.001, soft_min=0.01, soft_max=2.0, default=0.1, precision=3,
    )  # fmt: skip
    half: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Half Floats", description="Half the memory on the graphics card; errors are measured as stored"
    )

    stopped_text = "Cancelled; the scene is as it was"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """In steps, so that Blender stays alive."""
        return self.run_in_steps(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All at once."""
        return self.run_at_once(context)

    def _start(self, context: bpy.types.Context) -> Generator[tuple[float, str], None, Encoding]:
        from ..bridge import encoded

        return encoded.encoding_steps(context.scene, encoded.lights_of(context.scene), self.tolerance, self.half)

    def _store(self, context: bpy.types.Context, result: Encoding) -> None:
        from ..bridge import ways

        ways.show_encoded(context.scene, result)
        self.report({"INFO"}, f"{result.basis.K} numbers a colour, dE00 at most {result.largest_error:.2g}")
        for note in result.notes:
            self.report({"WARNING"}, note)

    def _progress(self, step: tuple[float, str]) -> tuple[float, str]:
        return step


class BakeColours(ManagedScene, bpy.types.Operator):
    """Leave the spectral basis: surfaces hold exact colours, which each change of light computes anew"""

    bl_idname = "spectral_booth.bake_colours"
    bl_label = "Bake Colours"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make all materials anew."""
        with reported(self) as outcome:
            from ..bridge import ways

            ways.show_baked(context.scene)
        return outcome.status


class SetMixture(ManagedScene, bpy.types.Operator):
    """Show the scene under up to three lights together, each with its share of the white's luminance"""

    bl_idname = "spectral_booth.set_mixture"
    bl_label = "Set Mixture"
    bl_options = {"REGISTER", "UNDO"}

    light_1: bpy.props.StringProperty(name="Light 1", search=scene_lights)  # type: ignore[valid-type]
    share_1: bpy.props.FloatProperty(name="Share", min=0.0, soft_max=1.0, default=1.0)  # type: ignore[valid-type]
    light_2: bpy.props.StringProperty(name="Light 2", search=scene_lights)  # type: ignore[valid-type]
    share_2: bpy.props.FloatProperty(name="Share", min=0.0, soft_max=1.0, default=1.0)  # type: ignore[valid-type]
    light_3: bpy.props.StringProperty(name="Light 3", search=scene_lights)  # type: ignore[valid-type]
    share_3: bpy.props.FloatProperty(name="Share", min=0.0, soft_max=1.0, default=1.0)  # type: ignore[valid-type]

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the lights if none was given; begin with what is shown."""
        if self.light_1:
            return self.execute(context)
        from spectral_core.lights import mixture_parts

        shown = context.scene.spectral_booth.light
        for number, (name, share) in enumerate((mixture_parts(shown) or [(shown, 1.0)])[:3], 1):
            setattr(self, f"light_{number}", name)
            setattr(self, f"share_{number}", share)
        return context.window_manager.invoke_props_dialog(self, width=360)

    def draw(self, context: bpy.types.Context) -> None:
        """A light and its share a row."""
        for number in (1, 2, 3):
            row = self.layout.split(factor=0.65)
            row.prop(self, f"light_{number}")
            row.prop(self, f"share_{number}", slider=True)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set lamps and materials."""
        with reported(self) as outcome:
            from spectral_core.lights import mixture_name

            from ..bridge import ways

            given = [(getattr(self, f"light_{number}"), getattr(self, f"share_{number}")) for number in (1, 2, 3)]
            parts = [(name, float(f"{share:.6g}")) for name, share in given if name and share > 0]
            name = mixture_name(parts) if parts else ""
            for note in ways.light(context.scene, name, int(context.scene.spectral_booth.level)).lighting.notes:
                self.report({"INFO"}, note)
        return outcome.status


class SetLampLight(ManagedScene, bpy.types.Operator):
    """Give the selected lamps a light of their own; without a name they have the scene's again"""

    bl_idname = "spectral_booth.set_lamp_light"
    bl_label = "Set Light of Lamps"
    bl_options = {"REGISTER", "UNDO"}

    light: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Light", description="Built-in name, file or mixture; the scene's if empty", search=scene_lights
    )
    lamps: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Lamps", description="Names of lamps, separated by semicolons; the selected ones if empty"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the light."""
        if self.properties.is_property_set("light"):
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self, width=360)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set those lamps, and the materials."""
        with reported(self) as outcome:
            from ..bridge import ways

            names = [each.strip() for each in self.lamps.split(";") if each.strip()]
            chosen = names or [item.name for item in context.selected_objects]
            for note in ways.set_lamp_light(context.scene, chosen, self.light).lighting.notes:
                self.report({"INFO"}, note)
        return outcome.status
