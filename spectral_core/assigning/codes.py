"""From a texel's RGB codes to its colour under the lamp that it was scanned under.

A profile says what colour a code means relative to a white: D50 for ICC, the display's own for ours. That white
is the perfect diffuser under the scanner's lamp; colours go from one white to the other by Bradford's
linear transform, the one that ICC profiles are made with (ICC.1:2010-12, annex E).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.assigning.icc_codes import IccProfile
from spectral_core.assigning.image import RgbImage
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.display import DisplayProfile, load_profile, srgb
from spectral_core.display.export.icc import D50, adaptation
from spectral_core.display.models.corrected import drive_of_lightness
from spectral_core.errors import DisplayError
from spectral_core.files import is_file, why_no_file

_LARGEST_ICC_MB = 64
# In x and y: real lamps of 5000 K.
_LIKE_D50 = 0.01


@dataclass(frozen=True)
class CodeColours:
    """What RGB codes mean under a lamp.

    Attributes
    ----------
    profile
        What says so, for people.
    XYZ
        Function of codes (n, 3) from 0 to 1: XYZ (n, 3) under the lamp, perfect diffuser Y = 1.
    warnings
        What was taken for granted.
    """

    profile: str
    XYZ: Callable[[Float64Array], Float64Array]
    warnings: tuple[str, ...] = ()


def code_colours(
    image: RgbImage, lamp_XYZ: Float64Array, icc: Path | None = None, profile: str | None = None
) -> CodeColours:
    """What the codes of an image mean: by an ICC file, else a display profile, else its own ICC profile, else sRGB.

    Parameters
    ----------
    image
        The image.
    lamp_XYZ
        (3,), the white under the scanner's lamp, Y = 1.
    icc, profile
        An ICC file, or a display profile by name or file; not both.

    Raises
    ------
    DisplayError, MissingExtraError
        If a profile cannot be used.
    """
    if icc is not None and profile is not None:
        raise DisplayError("--icc and --profile both say what the codes mean", remedy="give one of them")
    if icc is not None:
        return _by_icc(_read_icc(icc), icc, lamp_XYZ)
    if profile is not None:
        unused = ("the image's own ICC profile is not used: a display profile was given",) if image.icc else ()
        return _by_display(load_profile(profile), lamp_XYZ, unused)
    if image.icc:
        return _by_icc(image.icc, image.path, lamp_XYZ, " of the image itself")
    said = (
        f" (the file says '{image.colour_space}')"
        if image.colour_space and "srgb" not in image.colour_space.casefold()
        else ""
    )
    return _by_display(
        srgb(), lamp_XYZ, (f"no profile given and none in the image{said}: its codes are taken as sRGB",)
    )


def _by_display(profile: DisplayProfile, lamp_XYZ: Float64Array, warnings: tuple[str, ...]) -> CodeColours:
    white = profile.to_XYZ(np.ones(3))
    to_lamp = between(white, lamp_XYZ) / white[1]
    return CodeColours(profile.name, lambda codes: np.asarray(profile.to_XYZ(codes) @ to_lamp.T), warnings)


def _by_icc(data: bytes, where: Path, lamp_XYZ: Float64Array, whose: str = "") -> CodeColours:
    profile, to_lamp = IccProfile(data, where), between(D50, lamp_XYZ)
    warnings: tuple[str, ...] = ()
    if profile.of_input and np.abs(XYZ_to_xy(lamp_XYZ) - XYZ_to_xy(D50)).max() > _LIKE_D50:
        warnings = (
            "profiles of scanners and cameras mostly say what their test chart's colours are under D50, whatever the "
            "lamp: give --light D50 unless this one was made from colours under the lamp itself",
        )
    return CodeColours(
        f"ICC profile{whose}: {profile.name}",
        lambda codes: np.asarray(_XYZ_D50(profile.Lab(codes)) @ to_lamp.T),
        warnings,
    )


def between(white: Float64Array, other: Float64Array) -> Float64Array:
    """Bradford's (3, 3) from colours under one white XYZ to those under another, both at Y = 1."""
    return np.asarray(np.linalg.inv(adaptation(other)) @ adaptation(white))


def _XYZ_D50(Lab: Float64Array) -> Float64Array:
    lightness, a, b = Lab.T / 100
    return np.asarray(
        D50 * drive_of_lightness(np.stack([lightness + 0.232 * a, lightness, lightness - 0.58 * b], axis=1))
    )


def _read_icc(path: Path) -> bytes:
    remedy = "give an ICC profile"
    if not is_file(path):
        raise DisplayError(why_no_file(path), where=path, remedy=remedy)
    try:
        with path.open("rb") as stream:
            data = stream.read(_LARGEST_ICC_MB * 1_000_000 + 1)
    except OSError as error:
        raise DisplayError(f"cannot be read ({error.strerror})", where=path, remedy="check its permissions") from None
    if len(data) > _LARGEST_ICC_MB * 1_000_000:
        raise DisplayError(f"larger than {_LARGEST_ICC_MB} MB", where=path, remedy=remedy)
    return data
