"""Models of a display: device codes to XYZ and back, and how they are fitted to measurements."""

from spectral_core.display.models.matrix import (
    GAMMA_RANGE,
    LEAST_LIGHT,
    DisplayModel,
    GammaMatrix,
    SRGBCurve,
    check_gamma,
    checked_matrix,
    checked_vector,
    signed_power,
    srgb_decode,
    srgb_encode,
)

__all__ = [
    "GAMMA_RANGE",
    "LEAST_LIGHT",
    "DisplayModel",
    "GammaMatrix",
    "SRGBCurve",
    "check_gamma",
    "checked_matrix",
    "checked_vector",
    "signed_power",
    "srgb_decode",
    "srgb_encode",
]
