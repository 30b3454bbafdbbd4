"""Spectral basis: K numbers per surface or pixel, and the colours under all lights of a scene from them."""

from spectral_core.basis.adding import LightAdded, extend, stored_error, with_light
from spectral_core.basis.codes import CodeTolerance, code_difference
from spectral_core.basis.encoding import PackedTexture, encode_texture, encoding_steps
from spectral_core.basis.fitting import choose_basis, fit_basis
from spectral_core.basis.packing import Packed, choose_for_textures, packing_steps
from spectral_core.basis.samples import surface_samples
from spectral_core.basis.spectral_basis import BasisError, SpectralBasis

__all__ = [
    "BasisError",
    "CodeTolerance",
    "LightAdded",
    "Packed",
    "PackedTexture",
    "SpectralBasis",
    "choose_basis",
    "choose_for_textures",
    "code_difference",
    "encode_texture",
    "encoding_steps",
    "extend",
    "fit_basis",
    "packing_steps",
    "stored_error",
    "surface_samples",
    "with_light",
]
