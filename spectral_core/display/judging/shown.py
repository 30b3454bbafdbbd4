"""Codes that a renderer gave a display, against those that the display's profile asks for."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.profile import GAMUT_TOLERANCE, DisplayProfile, in_gamut
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.verification import Spread, spread


@dataclass(frozen=True)
class ShownPatch:
    """The pixels of one surface in a render.

    Attributes
    ----------
    pixels
        (n, 3) scene-linear: Rec.709, or XYZ where the renderer holds that.
    codes
        (n, 3) device codes, 0 to 1, of the same pixels through the display transform.
    exact
        (3,) the same of theory, mean over the pixels.
    """

    name: str
    pixels: Float64Array
    codes: Float64Array
    exact: Float64Array


@dataclass(frozen=True)
class ShownLight:
    """One light through a display, in 8-bit levels before rounding.

    Attributes
    ----------
    codes8
        Pixels in gamut: shown against the profile's own codes for the same scene-linear pixels. What
        the display transform is off by.
    codes8_clipped
        The same where the profile's codes need clipping, clipped on both sides.
    theory8
        Patches in gamut: mean shown codes against the profile's codes for the exact colour of theory.
        What transform and renderer are off by together.
    lost
        Patches outside the renderer's working space, whose negative channels it shows as 0; they are
        left out of `theory8`. None where its pixels are XYZ.
    patches, in_gamut
        How many were read, and how many of them need no clipping on the display.
    """

    name: str
    codes8: Spread
    codes8_clipped: Spread
    theory8: Spread
    lost: tuple[str, ...]
    patches: int
    in_gamut: int

    def to_json(self) -> dict[str, Any]:
        """The light's entry in the JSON of `verify --profile`."""
        return asdict(self)


def compare_shown(name: str, patches: list[ShownPatch], profile: DisplayProfile, in_XYZ: bool = False) -> ShownLight:
    """Compare the codes of a light's patches with a profile's; pixels are linear Rec.709 unless `in_XYZ`."""
    to_XYZ = np.eye(3) if in_XYZ else srgb_to_XYZ_matrix()
    wanted = profile.to_codes(np.concatenate([patch.pixels for patch in patches]) @ to_XYZ.T)
    difference = 255 * np.abs(np.concatenate([patch.codes for patch in patches]) - np.clip(wanted, 0, 1))
    inside = in_gamut(wanted)
    theory = np.array([patch.exact for patch in patches])
    held = (theory >= -GAMUT_TOLERANCE).all(axis=1)
    exact = profile.to_codes(theory @ to_XYZ.T)
    shown = np.array([patch.codes.mean(axis=0) for patch in patches])
    fits = in_gamut(exact)
    return ShownLight(
        name,
        spread(difference[inside]),
        spread(difference[~inside]),
        spread(255 * np.abs(shown - exact)[fits & held]),
        tuple(patch.name for patch, inside in zip(patches, held, strict=True) if not inside),
        len(patches),
        int(fits.sum()),
    )
