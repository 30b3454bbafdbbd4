"""Spectral colour for VR light booths: displays, lamps, surfaces and textures, without Blender.

The names below are the public ones. They are imported on first use: Blender imports this package
when it starts, and must not wait for NumPy or colour-science.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spectral_core.assigning import assign, read_library
    from spectral_core.baking import bake, bake_to_memory, level2_weights, project
    from spectral_core.basis import SpectralBasis, choose_basis, fit_basis
    from spectral_core.display import DisplayProfile, load_profile
    from spectral_core.lights import Light
    from spectral_core.scene import load_scene
    from spectral_core.spectra import Spectra, read_spectra
    from spectral_core.textures import ArrayTexture, HyperspectralTexture, Reading, open_texture
    from spectral_core.weights import WeightingFactors, weighting_factors

__version__ = "0.1.0"

_HOME = {
    "ArrayTexture": "textures",
    "DisplayProfile": "display",
    "HyperspectralTexture": "textures",
    "Light": "lights",
    "Reading": "textures",
    "Spectra": "spectra",
    "SpectralBasis": "basis",
    "WeightingFactors": "weights",
    "assign": "assigning",
    "bake": "baking",
    "bake_to_memory": "baking",
    "level2_weights": "baking",
    "choose_basis": "basis",
    "fit_basis": "basis",
    "load_profile": "display",
    "load_scene": "scene",
    "open_texture": "textures",
    "project": "baking",
    "read_library": "assigning",
    "read_spectra": "spectra",
    "weighting_factors": "weights",
}

__all__ = [
    "ArrayTexture",
    "DisplayProfile",
    "HyperspectralTexture",
    "Light",
    "Reading",
    "Spectra",
    "SpectralBasis",
    "WeightingFactors",
    "assign",
    "bake",
    "bake_to_memory",
    "choose_basis",
    "fit_basis",
    "level2_weights",
    "load_profile",
    "load_scene",
    "open_texture",
    "project",
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
