"""Hyperspectral textures: one file per format behind one `open_texture`."""

from spectral_core.textures.base import HyperspectralTexture, Tile
from spectral_core.textures.opening import open_texture

__all__ = ["HyperspectralTexture", "Tile", "open_texture"]
