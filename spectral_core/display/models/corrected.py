"""A LUT model with a smooth correction learnt from its residuals: channel interaction, power limits.

The residual of the cube root of XYZ over white, which is nearly uniform in lightness, is
interpolated over linear drive by kernel ridge regression with a squared-exponential kernel. Its
length and ridge are those of the smallest leave-one-out error on mixed colours, which has a closed
form (Rasmussen and Williams 2006, section 5.4.2). Over device codes instead of drive it fits a
little better (0.12 against 0.13 dE00 held out on a desktop display), but folds where a dark channel is
added to a bright one: there the codes' own effect vanishes and the correction's does not.

The model keeps the regression as a 3-D table: which drives would have given the measured colour if
the LUT model were the truth. Nodes are even in the lightness of drives, where the table is near the
identity and smooth, so that 13 a side carry it; it is fast, and it has an exact inverse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray, in_blocks
from spectral_core.display.models import checked_matrix, checked_vector
from spectral_core.display.models.curves import ToneCurve
from spectral_core.display.models.lattice import LatticeTable, lattice
from spectral_core.display.models.tone_models import LutMatrix, curves_from_json

LENGTHS = (0.3, 0.5, 0.8, 1.2, 1.8)
RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
# Over 9 nodes a simulated OLED's mean error grows by 0.02 dE00, over 13 by less than 0.01.
NODES = 13
# CIE 015:2018, 8.2.1.1: below this share of white, lightness is a line.
TOE, TOE_SLOPE, TOE_LIGHTNESS = (6 / 29) ** 3, (29 / 3) ** 3 / 100, 0.08


def lightness(drive: FloatArray) -> Float64Array:
    """CIE 1976 lightness, 0 to 1, of linear drive; its line goes on below zero."""
    # Each branch runs on what it is for, and their sum needs no choice: they meet at the toe.
    result: Float64Array = np.maximum(drive, TOE)
    np.power(result, 1 / 3, out=result)
    result *= 1.16
    result -= 0.16
    result += TOE_SLOPE * (np.minimum(drive, TOE) - TOE)
    return result


def drive_of_lightness(values: FloatArray) -> Float64Array:
    """The inverse of `lightness`."""
    root: Float64Array = np.maximum(values, TOE_LIGHTNESS)
    root += 0.16
    root /= 1.16
    result = root * root
    result *= root
    result += (np.minimum(values, TOE_LIGHTNESS) - TOE_LIGHTNESS) / TOE_SLOPE
    return result


@dataclass(frozen=True)
class CorrectedLut:
    """``XYZ = matrix @ linear(table(curves(codes))) + black_XYZ``; curves and table in lightness.

    Attributes
    ----------
    curves
        Red, green, blue: lightness of drive, 1 at code 1.
    table
        Lightness of the three drives to what they amount to together.
    matrix
        (3, 3), linear drive to XYZ.
    black_XYZ
        (3,), light at drive 0.
    """

    curves: tuple[ToneCurve, ToneCurve, ToneCurve]
    table: LatticeTable
    matrix: Float64Array
    black_XYZ: Float64Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", checked_matrix(self.matrix))
        object.__setattr__(self, "black_XYZ", checked_vector("black_XYZ", self.black_XYZ))

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        return in_blocks(self._forward, codes)

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        return in_blocks(lambda part: self._encode(self._lightness(part)), XYZ)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear drive (..., 3) of XYZ (..., 3), not clipped."""
        return in_blocks(lambda part: drive_of_lightness(self._lightness(part)), XYZ)

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes (..., 3) of linear drive (..., 3), not clipped."""
        return in_blocks(lambda part: self._encode(lightness(part)), linear)

    def _forward(self, codes: Float64Array) -> Float64Array:
        drives = np.stack([curve.forward(values) for curve, values in zip(self.curves, codes, strict=True)])
        drives = drive_of_lightness(self.table.forward_channels(drives))
        return np.asarray(self.matrix @ drives + self.black_XYZ[:, None])

    def _lightness(self, XYZ: Float64Array) -> Float64Array:
        """Lightness (3, n) of each channel's own drive for XYZ (3, n)."""
        drives = np.linalg.inv(self.matrix) @ (XYZ - self.black_XYZ[:, None])
        return self.table.inverse_channels(lightness(drives))

    def _encode(self, values: Float64Array) -> Float64Array:
        return np.stack([curve.inverse(each) for curve, each in zip(self.curves, values, strict=True)])

    def to_json(self) -> dict[str, object]:
        """Plain numbers."""
        return {
            "curves": [curve.values.tolist() for curve in self.curves],
            "table": self.table.nodes.tolist(),
            "matrix": self.matrix.tolist(),
            "black_XYZ": self.black_XYZ.tolist(),
        }

    @classmethod
    def from_json(cls, document: dict[str, object]) -> CorrectedLut:
        """From `to_json`."""
        table, matrix, black = (
            np.asarray(document[name], dtype=np.float64) for name in ("table", "matrix", "black_XYZ")
        )
        return cls(curves_from_json(document["curves"]), LatticeTable(table), matrix, black)


@dataclass(frozen=True)
class _Regression:
    """What is added to the cube root of XYZ over white, at linear drives."""

    centres: Float64Array
    weights: Float64Array
    length: float

    def __call__(self, drive: Float64Array) -> Float64Array:
        """The correction (n, 3) at drives (n, 3)."""
        squared = ((drive[:, None] - self.centres) ** 2).sum(axis=-1)
        return np.asarray(np.exp(-squared / (2 * self.length**2)) @ self.weights)


def fit_correction(
    base: LutMatrix, codes: Float64Array, XYZ: Float64Array, white_XYZ: Float64Array, judged: BoolArray
) -> CorrectedLut:
    """A correction of `base` from codes (n, 3) and XYZ (n, 3), judged by the patches `judged` (n,).

    The best regression whose table does not fold is taken; if all fold, no correction.
    """
    full = np.array([curve.values[-1] for curve in base.curves])
    red, green, blue = (_lightness_curve(curve) for curve in base.curves)
    matrix = base.matrix * full
    for regression in _regressions(base, codes, XYZ, white_XYZ, judged):
        table = LatticeTable.unfolded(_tabulated(matrix, full, base.black_XYZ, white_XYZ, regression))
        if table is not None:
            break
    else:
        table = LatticeTable(lattice(2))
    return CorrectedLut((red, green, blue), table, matrix, base.black_XYZ)


def _lightness_curve(curve: ToneCurve) -> ToneCurve:
    values = lightness(curve.values / curve.values[-1])
    values[0] = 0.0  # but for rounding it is
    return ToneCurve(values)


def _regressions(
    base: LutMatrix, codes: Float64Array, XYZ: Float64Array, white_XYZ: Float64Array, judged: BoolArray
) -> list[_Regression]:
    """One of each length and ridge, that of the smallest leave-one-out error first."""
    drive = base.decode(codes)
    residual = np.cbrt(XYZ / white_XYZ) - np.cbrt(base.forward(codes) / white_XYZ)
    squared = ((drive[:, None] - drive) ** 2).sum(axis=-1)
    found = []
    for length in LENGTHS:
        # One decomposition serves all ridges.
        values, vectors = np.linalg.eigh(np.exp(-squared / (2 * length**2)))
        turned = vectors.T @ residual
        for ridge in RIDGES:
            shrunk = 1 / (np.maximum(values, 0.0) + ridge)
            weights = vectors @ (shrunk[:, None] * turned)
            left_out = weights / (vectors**2 @ shrunk)[:, None]
            found.append((float((left_out[judged] ** 2).mean()), _Regression(drive, weights, length)))
    return [regression for _, regression in sorted(found, key=lambda each: each[0])]


def _tabulated(
    matrix: Float64Array, full: Float64Array, black: Float64Array, white: Float64Array, regression: _Regression
) -> Float64Array:
    """Nodes (n, n, n, 3): lightness of the drives that the LUT model needs for the corrected colour."""
    drive = drive_of_lightness(lattice(NODES).reshape(-1, 3))
    root = np.cbrt((drive @ matrix.T + black) / white) + regression(drive * full)
    corrected = (white * root**3 - black) @ np.linalg.inv(matrix).T
    # To a billionth: so much is certain, and the file stays short.
    return np.round(lightness(corrected), 9).reshape(NODES, NODES, NODES, 3)
