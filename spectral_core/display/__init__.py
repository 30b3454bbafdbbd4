"""Displays: which device codes a headset needs to show a given XYZ."""

from spectral_core.display.builtin import builtin_profile_names, load_profile, srgb
from spectral_core.display.models import GammaMatrix, SRGBCurve, signed_power, srgb_decode, srgb_encode
from spectral_core.display.profile import DisplayProfile, read_profile, write_profile

__all__ = [
    "DisplayProfile",
    "GammaMatrix",
    "SRGBCurve",
    "builtin_profile_names",
    "load_profile",
    "read_profile",
    "signed_power",
    "srgb",
    "srgb_decode",
    "srgb_encode",
    "write_profile",
]
