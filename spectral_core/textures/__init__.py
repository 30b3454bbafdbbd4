"""Hyperspectral textures: one file per format behind one `open_texture`."""

from spectral_core.textures.array_texture import ArrayTexture
from spectral_core.textures.base import HyperspectralTexture, Tile
from spectral_core.textures.opening import open_texture
from spectral_core.textures.reading import Reading

__all__ = ["ArrayTexture", "HyperspectralTexture", "Reading", "Tile", "open_texture"]
