"""A LUT model with a smooth correction learnt from its residuals: channel interaction, power limits.

The residual of the cube root of XYZ over white, which is nearly uniform in lightness, is
interpolated over linear drive by kernel ridge regression with a squared-exponential kernel. Its
length and ridge are those of the smallest leave-one-out error on mixed colours, which has a closed
form (Rasmussen and Williams 2006, section 5.4.2). Over device codes instead of drive it fits a
little better (0.12 against 0.13 dE00 held out on a desktop display), but cannot be inverted where a
dark channel is added to a bright one: there the codes' own effect vanishes and the correction's does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray, frozen
from spectral_core.display.models import checked_vector
from spectral_core.display.tone_models import LutMatrix
from spectral_core.errors import DisplayError

LENGTHS = (0.3, 0.5, 0.8, 1.2, 1.8)
RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
# Centres are evaluated this many pixels at a time, to stay within tens of megabytes.
_BLOCK = 16_384
_NEWTON_STEPS = 30
_HALVINGS = 8
# In the cube root of XYZ over white: what is solved, and what float64 can tell.
_SOLVED = 1e-9
_TOLERANCE = 1e-11
_DARKEST = 1e-8


@dataclass(frozen=True)
class CorrectedLut:
    """``XYZ = white * (cbrt(base(codes) / white) + correction(drive))**3``, drive by the base's curves.

    Attributes
    ----------
    base
        The LUT model that is corrected.
    white_XYZ
        (3,), what XYZ is divided by.
    centres, weights
        (n, 3) linear drives and kernel weights.
    length
        Of the kernel, in linear drive.
    """

    base: LutMatrix
    white_XYZ: Float64Array
    centres: Float64Array
    weights: Float64Array
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "white_XYZ", checked_vector("white_XYZ", self.white_XYZ))
        for name in ("centres", "weights"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.centres.shape != self.weights.shape or self.centres.ndim != 2 or self.centres.shape[1:] != (3,):
            raise DisplayError("'centres' and 'weights' must be (n, 3)", remedy="correct the profile")
        if not (np.isfinite(self.centres).all() and np.isfinite(self.weights).all() and self.length > 0):
            raise DisplayError("the correction holds something that is no number", remedy="correct the profile")

    def correction(self, drive: Float64Array) -> tuple[Float64Array, Float64Array]:
        """The correction (n, 3) at linear drives (n, 3), and its derivative (n, 3, 3): [pixel, XYZ, drive]."""
        value, slope = np.empty((len(drive), 3)), np.empty((len(drive), 3, 3))
        for first in range(0, len(drive), _BLOCK):
            part = slice(first, first + _BLOCK)
            offset = drive[part, None, :] - self.centres
            kernel = np.exp(-(offset**2).sum(axis=-1) / (2 * self.length**2))
            value[part] = kernel @ self.weights
            slope[part] = np.einsum("pn,nx,pnc->pxc", kernel, self.weights, -offset / self.length**2, optimize=True)
        return value, slope

    def forward(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3)."""
        drive = self.base.decode(np.asarray(codes, dtype=np.float64).reshape(-1, 3))
        root = self._base_root(drive) + self.correction(drive)[0]
        return np.asarray((self.white_XYZ * root**3).reshape(np.shape(codes)))

    def inverse(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped."""
        return self.encode(self.linear(XYZ))

    def encode(self, linear: FloatArray) -> Float64Array:
        """Device codes (..., 3) of linear drive (..., 3)."""
        return self.base.encode(linear)

    def linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear drive (..., 3) of XYZ (..., 3), not clipped: Newton steps from the base's own drive.

        In gamut the result is exact to 1e-9 of white. Far out of gamut the correction is not known
        and there may be no solution: such colours get the base's drive with the correction of the
        gamut's nearest drive, so that they stay outside.
        """
        target = np.asarray(XYZ, dtype=np.float64).reshape(-1, 3)
        wanted = np.cbrt(target / self.white_XYZ)
        drive = np.clip(self.base.linear(target), 0.0, self._full)
        waiting = np.arange(len(target))
        for _ in range(_NEWTON_STEPS):
            drive[waiting], error = self._improved(drive[waiting], wanted[waiting])
            waiting = waiting[error > _TOLERANCE]
            if not len(waiting):
                break
        else:
            error = np.abs(self._error(drive[waiting], wanted[waiting])).max(axis=1)
            far = waiting[error > _SOLVED]
            correction, _ = self.correction(np.clip(drive[far], 0.0, self._full))
            drive[far] = self.base.linear(self.white_XYZ * (wanted[far] - correction) ** 3)
        return np.asarray(drive.reshape(np.shape(XYZ)))

    @property
    def _full(self) -> Float64Array:
        """(3,) drive of full code."""
        return np.array([curve.values[-1] for curve in self.base.curves])

    def _base_root(self, drive: Float64Array) -> Float64Array:
        return np.asarray(np.cbrt((drive @ self.base.matrix.T + self.base.black_XYZ) / self.white_XYZ))

    def _error(self, drive: Float64Array, wanted: Float64Array) -> Float64Array:
        return np.asarray(self._base_root(drive) + self.correction(drive)[0] - wanted)

    def _improved(self, drive: Float64Array, wanted: Float64Array) -> tuple[Float64Array, Float64Array]:
        """One Newton step, halved until it helps; the new drive (n, 3) and the error (n,) before it."""
        correction, slope = self.correction(drive)
        root = self._base_root(drive)
        error = root + correction - wanted
        # d cbrt(x) = dx / (3 cbrt(x)^2), kept finite at black.
        steepness = 1 / (3 * np.maximum(root**2, _DARKEST) * self.white_XYZ)
        jacobian = steepness[:, :, None] * self.base.matrix + slope
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
        size, result = np.abs(error).max(axis=1), drive.copy()
        waiting = np.arange(len(drive))
        for halving in range(_HALVINGS):
            trial = drive[waiting] + step[waiting] / 2**halving
            better = np.abs(self._error(trial, wanted[waiting])).max(axis=1) < size[waiting]
            result[waiting[better]] = trial[better]
            waiting = waiting[~better]
            if not len(waiting):
                break
        return result, size

    def to_json(self) -> dict[str, object]:
        """Plain numbers."""
        return {
            "base": self.base.to_json(),
            "white_XYZ": self.white_XYZ.tolist(),
            "centres": self.centres.tolist(),
            "weights": self.weights.tolist(),
            "length": self.length,
        }

    @classmethod
    def from_json(cls, document: dict[str, object]) -> CorrectedLut:
        """From `to_json`."""
        base = document["base"]
        if not isinstance(base, dict):
            raise DisplayError("'base' must be a model", remedy="correct the profile")
        white, centres, weights = (
            np.asarray(document[name], dtype=np.float64) for name in ("white_XYZ", "centres", "weights")
        )
        return cls(LutMatrix.from_json(base), white, centres, weights, float(str(document["length"])))


def fit_correction(
    base: LutMatrix, codes: Float64Array, XYZ: Float64Array, white_XYZ: Float64Array, judged: BoolArray
) -> CorrectedLut:
    """A correction of `base` from codes (n, 3) and XYZ (n, 3), judged by the patches `judged` (n,)."""
    drive = base.decode(codes)
    residual = np.cbrt(XYZ / white_XYZ) - np.cbrt(base.forward(codes) / white_XYZ)
    squared = ((drive[:, None] - drive) ** 2).sum(axis=-1)
    best: tuple[float, float, Float64Array] = (np.inf, LENGTHS[-1], np.zeros_like(residual))
    for length in LENGTHS:
        # One decomposition serves all ridges.
        values, vectors = np.linalg.eigh(np.exp(-squared / (2 * length**2)))
        turned = vectors.T @ residual
        for ridge in RIDGES:
            shrunk = 1 / (np.maximum(values, 0.0) + ridge)
            weights = vectors @ (shrunk[:, None] * turned)
            left_out = weights / (vectors**2 @ shrunk)[:, None]
            error = float((left_out[judged] ** 2).mean())
            if error < best[0]:
                best = (error, length, weights)
    return CorrectedLut(base, white_XYZ, drive, best[2], best[1])
