"""How a light reaches the pixels: what lamps carry and what materials carry, per level.

Level 0, unmanaged: white lamps, the materials' RGB. Level 1: lamps of the light's RGB, the same
materials. Level 2, spectral: lamps of the light's RGB, materials of the exact colour relative to
it, so that their product is exact. A light without power in one of the three channels (sodium in
linear Rec.709) cannot be divided by: its lamps are neutral and the light is folded into the
materials.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display import srgb
from spectral_core.lights import Light
from spectral_core.surfaces import Surface

# Below this share of the lamp's largest channel the lamp cannot be divided by. Forward shading was
# measured to be exact down to a share of 2e-5 (HP1); at 1e-3 the quotients also stay far within half
# floats, which the deferred path and other people's image formats use.
SMALLEST_CHANNEL_SHARE = 1e-3
# Blender's working space is linear Rec.709: its lamps and materials cannot be negative.
WORKING_SPACE = "linear Rec.709"


@dataclass(frozen=True)
class Lighting:
    """A light at a level, ready for lamps and materials.

    Attributes
    ----------
    light, level, luminance
        Which light, level 0 to 2, and the luminance of the perfect diffuser (scene white = 1).
    light_rgb
        (3,) linear working-space RGB of the light at `luminance`, not clipped.
    lamp_rgb
        (3,) what lamps carry, never negative.
    folded
        Whether the light is folded into the materials.
    notes
        What a user should know, one sentence each.
    """

    light: Light
    level: int
    luminance: float
    light_rgb: Float64Array
    lamp_rgb: Float64Array
    folded: bool
    notes: tuple[str, ...]

    @property
    def gloss_rgb(self) -> Float64Array:
        """(3,) colour that neutral gloss needs for lamp times gloss to have the light's colour."""
        if not self.folded:
            return np.ones(3)
        return np.asarray(np.maximum(self.light_rgb, 0.0) / self.luminance)

    def material_rgb(self, surface: Surface, reference: Light) -> Float64Array:
        """What a surface's material carries: (3,) or (height, width, 3), not clipped."""
        if self.level < 2:
            return surface.reference_rgb(reference)
        return self.exact_rgb(surface) / self.lamp_rgb

    def exact_rgb(self, surface: Surface) -> Float64Array:
        """The surface's exact colour where the perfect diffuser has `luminance`: linear RGB, not clipped."""
        return srgb().to_linear(surface.XYZ(self.light)) * self.luminance


def fluorescence_notes(surfaces: Iterable[Surface]) -> list[str]:
    """A sentence about surfaces that were measured as fluorescent, which only their own lamp shows right."""
    names = [each.name for each in surfaces if each.texture is not None and each.texture.fluorescent]
    if not names:
        return []
    return [f"{', '.join(names)}: measured as fluorescent; what a lamp excites is left out, another one's too"]


def make_lighting(light: Light, level: int, luminance: float) -> Lighting:
    """A light at a level and luminance, with the lamps' colour and whether they can carry it."""
    light_rgb = srgb().to_linear(light.XYZ()) * luminance
    neutral = np.full(3, luminance)
    notes: list[str] = []
    folded = level == 2 and bool(light_rgb.min() < SMALLEST_CHANNEL_SHARE * light_rgb.max())
    if folded:
        channels = ", ".join(
            name
            for name, value in zip(("red", "green", "blue"), light_rgb, strict=True)
            if value < SMALLEST_CHANNEL_SHARE * light_rgb.max()
        )
        notes.append(
            f"{light.name} has too little {channels} in {WORKING_SPACE} for a lamp: "
            "the lamps are neutral, the light is in the materials"
        )
    if level == 1 and light_rgb.min() < 0:
        notes.append(f"{light.name} lies outside {WORKING_SPACE}: negative channels of the lamps are clipped")
    lamp_rgb = neutral if level == 0 or folded else np.maximum(light_rgb, 0.0)
    return Lighting(light, level, luminance, frozen(light_rgb), frozen(lamp_rgb), folded, tuple(notes))
