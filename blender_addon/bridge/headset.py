"""The profiles of a headset's eyes as a node group: what leaves a surface to what it must emit.

In a headset Blender ignores colour management, so every managed material turns the light that
leaves it into device codes after lighting. Which eye is being drawn is told to the shaders by a property
of the scene: after each eye a draw handler sets it for the next one.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from spectral_core.display import DisplayProfile, load_profile
from spectral_core.display.limits.luminance import eye_scene_whites, scene_white
from spectral_core.errors import BlenderError
from spectral_core.standards import srgb_to_XYZ_matrix

from ..eyes import EYE_PROPERTY
from . import display_nodes
from .node_builder import Builder, new_group


@dataclass(frozen=True)
class Shown:
    """A scene's display: one profile, or one per eye, and what the scene's white is shown at, of the display's own."""

    eyes: tuple[DisplayProfile, ...]
    scene_whites: tuple[float, ...]

    @property
    def notes(self) -> list[str]:
        """What a user should know, one sentence each."""
        names = ("Left", "Right") if len(self.eyes) == 2 else ("Both eyes",)
        notes = [
            f"{name}: {profile.name}, scene white at {scale:.3f} of the display's"
            for name, profile, scale in zip(names, self.eyes, self.scene_whites, strict=True)
        ]
        if len(self.eyes) == 2 and None in [profile.white_luminance_cd_m2 for profile in self.eyes]:
            notes.append("The profiles do not say their luminance: the eyes may differ in brightness")
        return notes


def load(left: str, right: str = "") -> Shown:
    """A profile for both eyes (built-in name or file), or one for each.

    Raises
    ------
    DisplayError
        If a profile cannot be read, or its display cannot show the scene's white.
    """
    eyes = tuple(load_profile(bpy.path.abspath(each)) for each in (left, right) if each)
    if not eyes:
        raise BlenderError("no profile was given", remedy="name a profile's JSON or a built-in one")
    whites = eye_scene_whites(*eyes) if len(eyes) == 2 else (scene_white(eyes[0]),)
    return Shown(eyes, whites)


def group(name: str, shown: Shown, from_XYZ: bool) -> bpy.types.NodeTree:
    """XYZ, or linear Rec.709, to what must be emitted, through one display or the one of the eye being drawn."""
    tree = new_group(name, {"Color": "Vector" if from_XYZ else "Color"}, {"Emission": "Color"})
    build = Builder(tree)
    matrix = np.eye(3) if from_XYZ else srgb_to_XYZ_matrix()
    emitted = []
    for profile, scale in zip(shown.eyes, shown.scene_whites, strict=True):
        XYZ = build.matrix(matrix * scale, build.inputs["Color"])
        emitted.append(build.group(display_nodes.display_group(profile, profile.name), XYZ))
    if len(emitted) == 1:
        build.finish(emitted[0])
    else:
        eye = build.attribute(EYE_PROPERTY)
        build.finish(build.combine(build.mix(eye, *(build.separate(each) for each in emitted))))
    return tree


def remove_group(tree: bpy.types.NodeTree) -> None:
    """Remove a node group, and those of displays that only it shows."""
    parts = {node.node_tree for node in tree.nodes if node.type == "GROUP"}
    bpy.data.node_groups.remove(tree)
    for part in parts:
        display_nodes.remove_group(part)
