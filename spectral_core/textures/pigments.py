"""placeholder until merged"""

from __future__ import annotations

from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture


def pigment_texture(name: str) -> HyperspectralTexture:
    raise TextureError(f"no pigment texture '{name}'")
