"""Models of a display: device codes to XYZ and back, and how they are fitted to measurements."""

from spectral_core.display.models.matrix import (
    DisplayModel,
    GammaMatrix,
    SRGBCurve,
    checked_matrix,
    checked_vector,
    signed_power,
    srgb_decode,
    srgb_encode,
)

__all__ = [
    "DisplayModel",
    "GammaMatrix",
    "SRGBCurve",
    "checked_matrix",
    "checked_vector",
    "signed_power",
    "srgb_decode",
    "srgb_encode",
]
