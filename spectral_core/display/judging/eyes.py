"""How the two eyes of a headset differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.chromaticities import XYZ_to_uv
from spectral_core.display.characterising.characterise import Characterisation, errors
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.verification import Percentiles, percentiles


@dataclass(frozen=True)
class EyeDifference:
    """The right eye against the left.

    Attributes
    ----------
    luminance_ratio
        White of the right over white of the left, None unless both were read in cd/m2.
    white_duv
        Distance of the whites in CIE 1976 u', v'.
    left_for_right, right_for_left
        dE00 over all patches of an eye predicted by the other's profile. Each eye has its own white
        at Y = 1, so the ratio of luminances is left out; the difference in the white's colour is in.
    """

    luminance_ratio: float | None
    white_duv: float
    left_for_right: Percentiles
    right_for_left: Percentiles


def eye_difference(
    left: Characterisation, right: Characterisation, left_read: Measurements, right_read: Measurements
) -> EyeDifference:
    """Compare two eyes that were characterised from `left_read` and `right_read`, in their files' units."""
    absolute = left_read.unit == right_read.unit == "cd/m2"
    whites = XYZ_to_uv(np.stack([left_read.white_XYZ, right_read.white_XYZ]))
    return EyeDifference(
        float(right_read.white_XYZ[1] / left_read.white_XYZ[1]) if absolute else None,
        float(np.hypot(*(whites[1] - whites[0]))),
        _shared(left, right),
        _shared(right, left),
    )


def _shared(owner: Characterisation, other: Characterisation) -> Percentiles:
    return percentiles(errors(owner.chosen.model, other.measured, other.measured.white_XYZ))
