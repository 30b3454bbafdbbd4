"""Coded lamps: lamps carry channels instead of colours, and materials turn light per channel into XYZ.

A renderer's red, green and blue are three independent sums of light. Lamps of up to three spectra each get
one: where a surface gets the irradiances e1, e2, e3 (1 gives the perfect diffuser its Y under that spectrum),
its exact colour is e1 X1 + e2 X2 + e3 X3, with its XYZ under each spectrum. No RGB is ever multiplied by
another, so that spectra mix exactly, and nothing is lost outside a working space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display import srgb
from spectral_core.errors import LightError
from spectral_core.lights import Light
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.surfaces import Surface

CHANNELS = 3

Parts = Sequence[tuple[Light, float]]


@dataclass(frozen=True)
class CodedLamps:
    """Which spectra the channels stand for, at a level.

    Attributes
    ----------
    lights
        One to three; the channels beyond carry nothing.
    level
        At levels 0 and 1 surfaces are RGB, under white lamps and under lamps of their spectrum's RGB.
    luminance
        Of the perfect diffuser (scene white = 1).
    """

    lights: tuple[Light, ...]
    level: int
    luminance: float

    def code(self, parts: Parts) -> Float64Array:
        """(3,) what a lamp of some of these lights, each with its share of the luminance, carries."""
        result = np.zeros(CHANNELS)
        total = sum(share for _, share in parts)
        names = [each.name for each in self.lights]
        for light, share in parts:
            result[names.index(light.name)] += share / total * self.luminance
        return result

    @property
    def lamp_rgb(self) -> Float64Array:
        """(3, 3) per channel, linear RGB that its lamps have at levels 0 and 1, white Y = 1, never negative."""
        result = np.zeros((CHANNELS, 3))
        for channel, light in enumerate(self.lights):
            result[channel] = 1.0 if self.level == 0 else np.maximum(srgb().to_linear(light.XYZ()), 0.0)
        return result

    @property
    def white_XYZ(self) -> Float64Array:
        """(3, 3) per channel, XYZ of the perfect diffuser, and of neutral gloss."""
        if self.level < 2:
            return np.asarray(self.lamp_rgb @ srgb_to_XYZ_matrix().T)
        result = np.zeros((CHANNELS, 3))
        for channel, light in enumerate(self.lights):
            result[channel] = light.XYZ()
        return result

    def XYZ(self, surface: Surface, reference: Light) -> list[Float64Array]:
        """A surface's XYZ per channel, white Y = 1: three times (3,) or (height, width, 3)."""
        if self.level < 2:
            rgb = surface.reference_rgb(reference)
            return [rgb * lamp @ srgb_to_XYZ_matrix().T for lamp in self.lamp_rgb]
        found = [surface.XYZ(light) for light in self.lights]
        return found + [np.zeros_like(found[0])] * (CHANNELS - len(found))


def coded_lamps(lamps: Sequence[Parts], level: int, luminance: float) -> CodedLamps:
    """Channels for lamps of these lights, in the order in which they occur.

    Raises
    ------
    LightError
        If there are more than three, or different ones of the same name.
    """
    named: dict[str, Light] = {}
    for light in (light for parts in lamps for light, _ in parts):
        known = named.setdefault(light.name, light)
        if not known.same_spectrum(light):
            raise LightError(f"two different lights are called '{light.name}'", remedy="rename one of them")
    lights = list(named.values())
    if len(lights) > CHANNELS:
        raise LightError(
            f"{len(lights)} spectra ({', '.join(each.name for each in lights)}), and coded lamps carry {CHANNELS}",
            remedy="give lamps the same lights, or use coloured lamps, which are approximate for mixtures",
        )
    return CodedLamps(tuple(lights), level, luminance)
