"""From a strip's columns to the pixels of an image, while they are still in the cache.

An image holds linear RGB of a display or its device codes. Where the display's primaries add up,
which is the rule, their matrix is folded into the weights of the projection and costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from spectral_core.arrays import Float32Array, Float64Array, IntArray
from spectral_core.display import DisplayProfile, SRGBCurve
from spectral_core.display.models.matrix import GammaMatrix
from spectral_core.display.profile import GAMUT_TOLERANCE

Pixels = npt.NDArray[Any]

# XYZ at which a model's linear part is looked at: black, the axes, and what a matrix must then give.
_PROBES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.4, 0.5, 0.6], [1.2, 0.1, 0.9]])
# IEC 61966-2-1.
_SRGB_SLOPE, _SRGB_END = 12.92, 0.0031308


@dataclass(frozen=True)
class Encoding:
    """How linear colours become pixels.

    Attributes
    ----------
    profile
        The display.
    levels
        Largest integer of a code, 255 or 65535; None for linear floats.
    """

    profile: DisplayProfile
    levels: int | None

    @property
    def dtype(self) -> npt.DTypeLike:
        """Of the pixels."""
        return np.float32 if self.levels is None else np.uint8 if self.levels < 256 else np.uint16

    def linear_part(self) -> tuple[Float64Array, Float64Array] | None:
        """Matrix (3, 3) and offset (3,) of ``linear = XYZ @ matrix + offset``, None if it is no such thing."""
        values = self.profile.to_linear(_PROBES)
        offset = values[0]
        matrix = values[1:4] - offset
        # Rounding of the model's own arithmetic, and no curve whatsoever.
        if np.abs(_PROBES @ matrix + offset - values).max() > 1e-9:
            return None
        return matrix, offset

    def pixels(self, linear: Float32Array) -> Pixels:
        """Pixels (..., 3) of linear RGB (..., 3): float32 as they are, or codes clipped to 0..1 and rounded."""
        if self.levels is None:
            return linear
        codes = self._codes(linear, np.float32(self.levels))
        codes += np.float32(0.5)
        return codes.astype(self.dtype)

    def _codes(self, linear: Float32Array, levels: np.float32) -> Float32Array:
        """Clipped codes from 0 to `levels`, powers in float32: within 1e-6 of white, a fifteenth of a 16-bit step."""
        model = self.profile.model
        if isinstance(model, GammaMatrix):
            # Exponents as long as a pixel's colours: NumPy's inner loop would have three steps otherwise.
            exponents = np.tile(1 / model.gamma, linear[0].size // 3).reshape(linear.shape[1:])
            return _power(_inside(linear), exponents.astype(np.float32), levels)
        if not isinstance(model, SRGBCurve):
            return np.asarray(levels * np.clip(model.encode(linear), 0.0, 1.0).astype(np.float32))
        inside = _inside(linear)
        curve = _power(inside, np.float32(1 / 2.4), np.float32(1.055) * levels)
        curve -= np.float32(0.055) * levels
        # The straight part lies above the curve below the threshold, and is cut off at its end above it.
        inside *= np.float32(_SRGB_SLOPE) * levels
        np.minimum(inside, np.float32(_SRGB_SLOPE * _SRGB_END) * levels, out=inside)
        return np.maximum(curve, inside, out=curve)


def _inside(linear: Float32Array) -> Float32Array:
    """Clipped to 0..1: NumPy 1.26's `clip` takes three times as long."""
    inside = np.maximum(linear, np.float32(0.0))
    return np.minimum(inside, np.float32(1.0), out=inside)


def _power(base: Float32Array, exponent: Float32Array | np.float32, factor: np.float32) -> Float32Array:
    """``factor * base ** exponent`` for bases from 0 to 1, within 1e-6 of the factor, in a third of `power`'s time."""
    with np.errstate(divide="ignore"):  # 0 has the logarithm that gives 0 again
        result = np.log2(base)
    result *= exponent
    result += np.log2(factor)
    return np.asarray(np.exp2(result, out=result))


def count_outside(linear: Float32Array) -> IntArray:
    """How many of the colours (n, pictures, 3) are out of gamut in each picture: (pictures,)."""
    low, high = np.float32(-GAMUT_TOLERANCE), np.float32(1 + GAMUT_TOLERANCE)
    if linear.min() >= low and linear.max() <= high:
        return np.zeros(linear.shape[1], dtype=np.int64)
    outside = linear < low
    outside |= linear > high
    # `any` and `sum` over short axes take ten times as long.
    colours = outside[..., 0] | outside[..., 1] | outside[..., 2]
    return np.array([np.count_nonzero(colours[:, index]) for index in range(linear.shape[1])])
