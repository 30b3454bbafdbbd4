"""Light a managed scene: lamps and materials for a light at a level, and the white calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from spectral_core.errors import BlenderError
from spectral_core.lighting import Lighting, fluorescence_notes, make_lighting
from spectral_core.lights import Light
from spectral_core.scene import SceneDescription, resolve_light
from spectral_core.surfaces import scene_surfaces

from . import headset, materials, measure, state


@dataclass(frozen=True)
class Applied:
    """A lighting as it was put into a scene: colours that lost a negative channel, extended ends."""

    lighting: Lighting
    clipped: dict[str, int]
    extended: dict[str, float]


@dataclass(frozen=True)
class Calibrated:
    """White's luminance before and after, and the factor on all lamps."""

    before: float
    after: float
    factor: float


def apply(scene: bpy.types.Scene, light_name: str, level: int) -> Applied:
    """Set every lamp and material for a light (built-in or file) at a level."""
    description = state.description(scene)
    light = resolve_light(light_name, description.folder)
    reference = Light.load(description.reference)
    lighting = make_lighting(light, level, description.white.luminance)
    surfaces = scene_surfaces(description)
    for lamp in state.managed_lamps(scene):
        lamp.data.color = lighting.lamp_rgb.tolist()
    clipped, extended = {}, {}
    for name, material in state.managed_materials(scene).items():
        materials.set_gloss_colour(material, lighting.gloss_rgb)
        clipped[name] = materials.set_colour(material, lighting.material_rgb(surfaces[name], reference))
        extended[name] = surfaces[name].extended(light) if level == 2 else 0.0
    scene.spectral_booth.light = light_name
    scene.spectral_booth.level = str(level)
    shown = [surfaces[name] for name in state.managed_materials(scene)]
    lighting = replace(lighting, notes=(*lighting.notes, *(fluorescence_notes(shown) if level == 2 else ())))
    scene.spectral_booth.notes = "; ".join(lighting.notes)
    return Applied(lighting, clipped, extended)


def calibrate_white(scene: bpy.types.Scene) -> Calibrated:
    """Scale all lamps so that the white target's rendered luminance is what the scene asks for.

    The target is rendered white under neutral lamps; the measured luminance is proportional to
    the lamps' energy, so that one step is exact.

    Raises
    ------
    BlenderError
        If no light reaches the target, or the camera does not see it.
    """
    description = state.description(scene)
    white = state.described_object(scene, description.white.object)
    if white is None:
        raise BlenderError(f"the white target '{description.white.object}' is gone", remedy="build the scene again")
    mask = measure.identify(scene).masks[white.name]
    if not mask.any():
        raise BlenderError(
            f"the camera does not see the white target '{white.name}'", remedy="move the camera or the target"
        )
    with headset.scene_linear(scene):
        before = _white_luminance(scene, description, white, mask)
        factor = description.white.luminance / before
        for lamp in state.managed_lamps(scene):
            lamp.data.energy *= factor
        return Calibrated(before, _white_luminance(scene, description, white, mask), factor)


def _white_luminance(
    scene: bpy.types.Scene, description: SceneDescription, white: bpy.types.Object, mask: np.ndarray
) -> float:
    """Mean luminance of the target under neutral lamps of the scene's luminance."""
    reflectance = scene_surfaces(description)[state.surface_name(white)].XYZ(Light.load(description.reference))[1]
    irradiance = measure.illumination(scene, within=mask).irradiance
    luminance = float(np.mean(irradiance[mask]) * reflectance * description.white.luminance)
    if not luminance > 0:
        raise BlenderError(f"no light reaches the white target '{white.name}'", remedy="aim a lamp at it")
    return luminance
