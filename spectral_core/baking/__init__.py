"""Hyperspectral textures under lights: one streamed pass, all lights at once."""

from spectral_core.baking.in_memory import BakedArrays, bake_to_memory, baking_steps
from spectral_core.baking.pixels import PixelCounts
from spectral_core.baking.projection import level2_weights, project
from spectral_core.baking.records import BakedImage
from spectral_core.baking.run import BakeResult, bake, file_name

__all__ = [
    "BakeResult",
    "BakedArrays",
    "BakedImage",
    "PixelCounts",
    "bake",
    "bake_to_memory",
    "baking_steps",
    "file_name",
    "level2_weights",
    "project",
]
