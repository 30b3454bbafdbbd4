"""What measurements say of a display before any model: additivity, black, noise, ramps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.measurements import SAME_CODE, Measurements
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

# Channels that sum to within this of white are additive as far as instruments tell (1 % in Y).
ADDITIVE = 0.02
# A step down a ramp larger than this share of white is no noise.
_RAMP_TOLERANCE = 2e-3


@dataclass(frozen=True)
class Checks:
    """What was found.

    Attributes
    ----------
    additivity_error, additivity_XYZ
        (R + G + B - 2 black) / white - 1: of Y, and (3,) of X, Y and Z.
    black_share
        Y of black over Y of white.
    noise_dE00
        Mean dE00 of repeated patches from their mean, None without repeats.
    warnings
        Verdicts worth a sentence.
    """

    additivity_error: float
    additivity_XYZ: Float64Array
    black_share: float
    noise_dE00: float | None
    warnings: tuple[str, ...]


def check(measured: Measurements) -> Checks:
    """Check a set of measurements."""
    white, black = measured.white_XYZ, measured.black_XYZ
    primaries = [measured.at(*np.eye(3)[index]) for index in range(3)]
    total = np.sum([each for each in primaries if each is not None], axis=0) - 2 * black
    additivity = np.asarray(total / white - 1)
    warnings = list(measured.warnings)
    if abs(additivity[1]) > ADDITIVE:
        warnings.append(f"not additive: red, green and blue sum to {additivity[1]:+.1%} of white's luminance")
    if measured.at(0, 0, 0) is None:
        warnings.append("black was not measured and is taken as 0")
    for index, name in enumerate(("red", "green", "blue", "grey")):
        chosen = measured.grey if index == 3 else measured.channel(index)
        warnings += _ramp_warnings(name, measured.subset(chosen), white[1])
    return Checks(float(additivity[1]), additivity, float(black[1] / white[1]), noise(measured), tuple(warnings))


def noise(measured: Measurements) -> float | None:
    """Mean dE00 of repeated patches from their own mean; None if no patch was repeated."""
    keys = np.round(measured.codes / SAME_CODE).astype(int)
    _, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    repeated = count[group] > 1
    if not repeated.any():
        return None
    means = np.stack([np.bincount(group, measured.XYZ[:, axis]) / count for axis in range(3)], axis=1)
    white = measured.white_XYZ
    difference = delta_E_2000(XYZ_to_Lab(measured.XYZ[repeated], white), XYZ_to_Lab(means[group[repeated]], white))
    return float(difference.mean())


def _ramp_warnings(name: str, ramp: Measurements, white_Y: float) -> list[str]:
    order = np.argsort(ramp.codes.max(axis=1), kind="stable")
    Y = ramp.XYZ[order, 1]
    codes = ramp.codes[order].max(axis=1)
    drop = (np.maximum.accumulate(Y) - Y) / white_Y if len(Y) else np.zeros(0)
    if not len(Y) or drop.max() <= _RAMP_TOLERANCE:
        return []
    at = int(drop.argmax())
    return [f"the {name} ramp falls at code {codes[at]:.3f} by {drop[at]:.2%} of white"]
