"""Built-in profiles: sRGB and the two published characterisations of the HTC Vive."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from spectral_core import standards
from spectral_core.chromaticities import xyY_to_XYZ
from spectral_core.display.models import GammaMatrix, SRGBCurve
from spectral_core.display.profile import DisplayProfile, read_profile

# Diaz-Barrancas et al. 2021 (Electronics 10:2852), Algorithm 1: XYZ to linear RGB, taken literally.
_ALGORITHM_1 = np.array([[2.19, -0.69, -0.32], [-0.87, 1.80, 0.02], [0.04, -0.086, 0.88]])
# Diaz-Barrancas et al. 2020 (Sensors 20:5658), Table 1: x, y and Y relative to white.
_TABLE_1 = {
    "white": (0.299, 0.315, 100.0),
    "red": (0.667, 0.332, 30.3),
    "green": (0.217, 0.710, 75.4),
    "blue": (0.139, 0.051, 7.8),
    "black": (0.311, 0.307, 0.4),
}


@cache
def srgb() -> DisplayProfile:
    """The sRGB display, IEC 61966-2-1: D65 white at Y = 1, no black."""
    return DisplayProfile("sRGB", SRGBCurve(standards.srgb_to_XYZ_matrix()), "IEC 61966-2-1:1999")


@cache
def _htc_vive_2021() -> DisplayProfile:
    model = GammaMatrix(np.array([2.34, 2.30, 2.26]), np.linalg.inv(_ALGORITHM_1), np.zeros(3))
    return DisplayProfile("htc-vive-2021", model, "Diaz-Barrancas et al. 2021, Electronics 10:2852, Algorithm 1")


@cache
def _htc_vive_2020() -> DisplayProfile:
    """Primaries scaled per channel so that they sum to the measured white (the headset is not
    additive: unscaled they sum to 113.5 %), black added.
    """
    XYZ = {name: xyY_to_XYZ(np.array(values)) / 100 for name, values in _TABLE_1.items()}
    primaries = np.stack([XYZ["red"], XYZ["green"], XYZ["blue"]], axis=1)
    matrix = primaries * np.linalg.solve(primaries, XYZ["white"])
    model = GammaMatrix(np.array([2.43, 2.38, 2.38]), matrix, XYZ["black"])
    return DisplayProfile("htc-vive-2020", model, "Diaz-Barrancas et al. 2020, Sensors 20:5658, Table 1")


_BUILTIN = {"sRGB": srgb, "htc-vive-2021": _htc_vive_2021, "htc-vive-2020": _htc_vive_2020}


def builtin_profile_names() -> tuple[str, ...]:
    """Names that `load_profile` knows."""
    return tuple(_BUILTIN)


def load_profile(name_or_path: str | Path) -> DisplayProfile:
    """A profile by built-in name (case ignored) or from a JSON file.

    Raises
    ------
    DisplayError
        If it is neither.
    """
    for name, make in _BUILTIN.items():
        if str(name_or_path).casefold() == name.casefold():
            return make()
    return read_profile(Path(name_or_path))
