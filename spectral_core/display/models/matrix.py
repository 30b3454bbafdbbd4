"""Display models: device codes to XYZ and back.

Codes run from 0 to 1; XYZ has Y = 1 for the display's white. Both directions are defined for all
real numbers, by odd symmetry about zero, so that colours outside the gamut keep their size and
sign instead of becoming NaN; whoever shows them clips and counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, frozen
from spectral_core.errors import DisplayError

# No display comes near these; beyond them codes overflow instead of being out of gamut.
GAMMA_RANGE = (0.1, 10.0)
_LARGEST_XYZ = 100.0
# Of white: no instrument tells less from no light, and a contrast to it is no number to be told.
LEAST_LIGHT = 1e-12


class DisplayModel(Protocol):
    """What every display model can do; arrays are (..., 3)."""

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ of device codes."""

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes of XYZ, not clipped."""

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear device RGB of XYZ, not clipped; 1 is full drive."""

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes of linear device RGB, not clipped."""


def signed_power(values: FloatArray, exponent: Float64Array | float) -> Float64Array:
    """sign(v) |v|^exponent: a power that never gives NaN."""
    return np.asarray(np.sign(values) * np.abs(values) ** exponent)


def srgb_encode(linear: FloatArray) -> Float64Array:
    """SRGB codes of linear sRGB (IEC 61966-2-1), by odd symmetry below zero, not clipped.

    The type of the input is kept: float32 stays float32.
    """
    magnitude = np.abs(linear)
    # The power runs on every element; below the threshold its result is not used.
    curve = 1.055 * magnitude ** (1 / 2.4) - 0.055
    return np.asarray(np.sign(linear) * np.where(magnitude <= 0.0031308, 12.92 * magnitude, curve))


def srgb_decode(codes: FloatArray) -> Float64Array:
    """Linear sRGB of sRGB codes (IEC 61966-2-1), by odd symmetry below zero."""
    magnitude = np.abs(codes)
    curve = ((magnitude + 0.055) / 1.055) ** 2.4
    return np.asarray(np.sign(codes) * np.where(magnitude <= 0.04045, magnitude / 12.92, curve))


def check_gamma(gamma: Float64Array) -> None:
    """Refuse gammas (3,) that no display has."""
    if not ((gamma >= GAMMA_RANGE[0]) & (gamma <= GAMMA_RANGE[1])).all():
        raise DisplayError(
            f"'gamma' must be from {GAMMA_RANGE[0]:g} to {GAMMA_RANGE[1]:g}", remedy="correct the profile"
        )


def checked_vector(name: str, values: Float64Array) -> Float64Array:
    """Three finite numbers, frozen."""
    vector = frozen(values)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise DisplayError(f"'{name}' must be three finite numbers", remedy="correct the profile")
    if np.abs(vector).max() > _LARGEST_XYZ:
        raise DisplayError(f"'{name}' is not relative to white Y = 1", remedy="correct the profile")
    return vector


def checked_matrix(values: Float64Array) -> Float64Array:
    """An invertible (3, 3) matrix, frozen."""
    matrix = frozen(values)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise DisplayError("'matrix' must be 3 x 3 finite numbers", remedy="correct the profile")
    if np.abs(matrix).max() > _LARGEST_XYZ:
        raise DisplayError("'matrix' is not relative to white Y = 1", remedy="correct the profile")
    if np.linalg.cond(matrix) > 1e8:
        raise DisplayError("'matrix' cannot be inverted: its primaries lie on a line", remedy="correct the profile")
    return matrix


@dataclass(frozen=True)
class GammaMatrix:
    """The published model: a gamma per channel, a matrix, a black (Diaz-Barrancas et al. 2020).

    ``XYZ = matrix @ codes**gamma + black_XYZ``

    Attributes
    ----------
    gamma
        (3,), from 0.1 to 10.
    matrix
        (3, 3), linear device RGB to XYZ, columns the primaries' XYZ at full drive less black.
    black_XYZ
        (3,), light at codes 0.
    """

    gamma: Float64Array
    matrix: Float64Array
    black_XYZ: Float64Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "gamma", checked_vector("gamma", self.gamma))
        object.__setattr__(self, "matrix", checked_matrix(self.matrix))
        object.__setattr__(self, "black_XYZ", checked_vector("black_XYZ", self.black_XYZ))
        check_gamma(self.gamma)

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        return np.asarray(signed_power(np.asarray(codes), self.gamma) @ self.matrix.T + self.black_XYZ)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear device RGB (..., 3) of XYZ (..., 3), not clipped."""
        return np.asarray((np.asarray(XYZ) - self.black_XYZ) @ np.linalg.inv(self.matrix).T)

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes (..., 3) of linear device RGB (..., 3), not clipped."""
        return signed_power(np.asarray(linear), 1 / self.gamma)

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        return self.encode(self.linear(XYZ))

    def to_json(self) -> dict[str, object]:
        """Plain numbers."""
        return {name: getattr(self, name).tolist() for name in ("gamma", "matrix", "black_XYZ")}

    @classmethod
    def from_json(cls, document: dict[str, object]) -> GammaMatrix:
        """From `to_json`."""
        return cls(*(np.asarray(document[name], dtype=np.float64) for name in ("gamma", "matrix", "black_XYZ")))


@dataclass(frozen=True)
class SRGBCurve:
    """A matrix and the piecewise sRGB curve."""

    matrix: Float64Array

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        return np.asarray(srgb_decode(np.asarray(codes)) @ self.matrix.T)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear sRGB (..., 3) of XYZ (..., 3), not clipped."""
        return np.asarray(np.asarray(XYZ) @ np.linalg.inv(self.matrix).T)

    def encode(self, linear: FloatArray) -> Float64Array:
        """SRGB codes (..., 3) of linear sRGB (..., 3), not clipped."""
        return srgb_encode(np.asarray(linear))

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        return self.encode(self.linear(XYZ))
