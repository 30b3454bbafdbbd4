"""A .cube table (Adobe Cube LUT 1.0): from sRGB's primaries to device codes."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, FloatArray
from spectral_core.display.export.luts import write_cube
from spectral_core.display.export.names import export_name
from spectral_core.display.models import srgb_decode, srgb_encode
from spectral_core.display.models.lattice import lattice
from spectral_core.display.profile import DisplayProfile

CubeInput = Literal["srgb", "linear"]
# What most software takes; a node each 4 of 255 levels.
NODES = 65
_INPUTS = {
    "srgb": "sRGB-encoded RGB (IEC 61966-2-1)",
    "linear": "linear RGB of sRGB's primaries (scene-linear Rec.709)",
}


def export_cube(profile: DisplayProfile, path: Path, read_as: CubeInput = "srgb") -> Path:
    """Write device codes on an even lattice of sRGB, encoded or linear.

    Encoded input suits displays: its nodes are dense where codes change. Colours outside sRGB
    cannot be asked for. Codes are clipped: across the gamut's surface that interpolates better than
    the powers of negative drives would.
    """
    values = lattice(NODES)
    codes = profile.to_codes((srgb_decode(values) if read_as == "srgb" else values) @ standards.srgb_to_XYZ_matrix().T)
    comments = (
        f"Device codes of the display: {export_name(profile)}",
        f"Input from 0 to 1: {_INPUTS[read_as]}; 1 1 1 is D65 at the luminance of the display's white.",
        "Colorimetric: the input's XYZ is what the display shows, its white is not adapted.",
        "Output: device codes from 0 to 1; colours out of the display's gamut are clipped channel by channel.",
        "Interpolate between nodes by tetrahedra, or else linearly.",
    )
    write_cube(path, np.clip(codes, 0.0, 1.0), comments)
    return path


def cube_input(XYZ: FloatArray, read_as: CubeInput) -> Float64Array:
    """What such a table is asked with (..., 3) for XYZ (..., 3)."""
    linear = np.asarray(XYZ) @ np.linalg.inv(standards.srgb_to_XYZ_matrix()).T
    return srgb_encode(linear) if read_as == "srgb" else np.asarray(linear)
