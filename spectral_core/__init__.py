"""Spectral colour for VR light booths: displays, lamps, surfaces and textures, without Blender.

The names below are the public ones. They are imported on first use: Blender imports this package
when it starts, and must not wait for NumPy or colour-science.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spectral_core.assigning import assign, read_library
    from spectral_core.baking import bake
    from spectral_core.display import DisplayProfile, load_profile
    from spectral_core.lights import Light
    from spectral_core.scene import load_scene
    from spectral_core.spectra import Spectra, read_spectra
    from spectral_core.textures import HyperspectralTexture, open_texture
    from spectral_core.weights import WeightingFactors, weighting_factors

__version__ = "0.1.0"

_HOME = {
    "DisplayProfile": "display",
    "HyperspectralTexture": "textures",
    "Light": "lights",
    "Spectra": "spectra",
    "WeightingFactors": "weights",
    "assign": "assigning",
    "bake": "baking",
    "load_profile": "display",
    "load_scene": "scene",
    "open_texture": "textures",
    "read_library": "assigning",
    "read_spectra": "spectra",
    "weighting_factors": "weights",
}

__all__ = [
    "DisplayProfile",
    "HyperspectralTexture",
    "Light",
    "Spectra",
    "WeightingFactors",
    "assign",
    "bake",
    "load_profile",
    "load_scene",
    "open_texture",
    "read_library",
    "read_spectra",
    "weighting_factors",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
