"""Models with a tone curve per channel: tables, and the gain-offset-gamma formula."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, in_blocks
from spectral_core.display.models import check_gamma, checked_matrix, checked_vector, signed_power
from spectral_core.display.models.curves import ToneCurve
from spectral_core.errors import DisplayError

# Near 1 the rest of the curve has no codes.
_LARGEST_THRESHOLD = 0.99


@dataclass(frozen=True)
class LutMatrix:
    """A tone curve per channel, a matrix, a black: ``XYZ = matrix @ curve(codes) + black_XYZ``.

    With curves from the grey ramp (Diaz-Barrancas et al. 2024) greys are exact even on displays
    whose channels do not add up.

    Attributes
    ----------
    curves
        Red, green, blue.
    matrix
        (3, 3), linear drive to XYZ.
    black_XYZ
        (3,), light at codes 0.
    """

    curves: tuple[ToneCurve, ToneCurve, ToneCurve]
    matrix: Float64Array
    black_XYZ: Float64Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", checked_matrix(self.matrix))
        object.__setattr__(self, "black_XYZ", checked_vector("black_XYZ", self.black_XYZ))

    def decode(self, codes: FloatArray) -> Float64Array:
        """Linear drive (..., 3) of codes (..., 3)."""
        return in_blocks(self._decode, codes)

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        return in_blocks(lambda part: self.matrix @ self._decode(part) + self.black_XYZ[:, None], codes)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear drive (..., 3) of XYZ (..., 3), not clipped."""
        return np.asarray((np.asarray(XYZ) - self.black_XYZ) @ np.linalg.inv(self.matrix).T)

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes (..., 3) of linear drive (..., 3), not clipped."""
        return in_blocks(self._encode, linear)

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        matrix = np.linalg.inv(self.matrix)
        return in_blocks(lambda part: self._encode(matrix @ (part - self.black_XYZ[:, None])), XYZ)

    def _decode(self, codes: Float64Array) -> Float64Array:
        return np.stack([curve.forward(values) for curve, values in zip(self.curves, codes, strict=True)])

    def _encode(self, linear: Float64Array) -> Float64Array:
        return np.stack([curve.inverse(values) for curve, values in zip(self.curves, linear, strict=True)])

    def to_json(self) -> dict[str, object]:
        """Plain numbers."""
        return {
            "curves": [curve.values.tolist() for curve in self.curves],
            "matrix": self.matrix.tolist(),
            "black_XYZ": self.black_XYZ.tolist(),
        }

    @classmethod
    def from_json(cls, document: dict[str, object]) -> LutMatrix:
        """From `to_json`."""
        matrix, black = (np.asarray(document[name], dtype=np.float64) for name in ("matrix", "black_XYZ"))
        return cls(curves_from_json(document["curves"]), matrix, black)


def curves_from_json(curves: object) -> tuple[ToneCurve, ToneCurve, ToneCurve]:
    """Three tone curves."""
    if not isinstance(curves, list) or len(curves) != 3:
        raise DisplayError("'curves' must be three lists", remedy="correct the profile")
    red, green, blue = (ToneCurve(np.asarray(each, dtype=np.float64)) for each in curves)
    return red, green, blue


@dataclass(frozen=True)
class GainOffsetGamma:
    """``drive = ((code - threshold) / (1 - threshold)) ** gamma`` above a threshold per channel.

    The gain-offset-gamma model (Berns 1996) with gain and offset summing to one. Codes below the
    threshold give black; the inverse gives the threshold for drive 0.
    """

    gamma: Float64Array
    threshold: Float64Array
    matrix: Float64Array
    black_XYZ: Float64Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", checked_matrix(self.matrix))
        for name in ("gamma", "threshold", "black_XYZ"):
            object.__setattr__(self, name, checked_vector(name, getattr(self, name)))
        check_gamma(self.gamma)
        if (self.threshold > _LARGEST_THRESHOLD).any():
            raise DisplayError(f"'threshold' must be at most {_LARGEST_THRESHOLD}", remedy="correct the profile")

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        scaled = (np.asarray(codes) - self.threshold) / (1 - self.threshold)
        drive = np.where(scaled > 0, signed_power(scaled, self.gamma), 0.0)
        return np.asarray(drive @ self.matrix.T + self.black_XYZ)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear drive (..., 3) of XYZ (..., 3), not clipped."""
        return np.asarray((np.asarray(XYZ) - self.black_XYZ) @ np.linalg.inv(self.matrix).T)

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes (..., 3) of linear drive (..., 3); negative drive continues by odd symmetry."""
        return np.asarray(signed_power(np.asarray(linear), 1 / self.gamma) * (1 - self.threshold) + self.threshold)

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        return self.encode(self.linear(XYZ))

    def to_json(self) -> dict[str, object]:
        """Plain numbers."""
        return {name: getattr(self, name).tolist() for name in ("gamma", "threshold", "matrix", "black_XYZ")}

    @classmethod
    def from_json(cls, document: dict[str, object]) -> GainOffsetGamma:
        """From `to_json`."""
        return cls(
            *(np.asarray(document[name], dtype=np.float64) for name in ("gamma", "threshold", "matrix", "black_XYZ"))
        )
