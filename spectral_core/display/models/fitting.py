"""Fit display models to measurements, simplest first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import GAMMA_RANGE, DisplayModel, GammaMatrix
from spectral_core.display.models.corrected import fit_correction
from spectral_core.display.models.curves import fit_curve
from spectral_core.display.models.tone_models import GainOffsetGamma, LutMatrix

ASSUMED_GAMMA = 2.2


@dataclass(frozen=True)
class ModelKind:
    """A kind of model: how to fit it, and the fewest samples per ramp, greys and mixes it needs."""

    name: str
    fit: Callable[[Measurements], DisplayModel]
    ramp: int = 0
    greys: int = 0
    mixed: int = 0

    def supported_by(self, measured: Measurements) -> bool:
        """Whether the data is enough to fit it."""
        ramps = min(int(measured.channel(index).sum()) for index in range(3))
        return ramps >= self.ramp and int(measured.grey.sum()) >= self.greys and int(measured.mixed.sum()) >= self.mixed


def primaries(measured: Measurements, black: Float64Array) -> Float64Array:
    """(3, 3), columns the XYZ of the primaries at full drive less black."""
    columns = [measured.at(*row) for row in np.eye(3)]
    return np.stack([column - black for column in columns if column is not None], axis=1)


def ramp_drive(measured: Measurements, index: int, black: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Codes and drives (n,) of one channel's ramp, black included: the projection on its primary."""
    chosen = measured.channel(index) | (measured.codes.max(axis=1) == 0)
    full = primaries(measured, black)[:, index]
    return measured.codes[chosen, index], (measured.XYZ[chosen] - black) @ full / (full @ full)


def gamma_fit(codes: Float64Array, drive: Float64Array) -> tuple[float, float]:
    """Gamma of a ramp by regression through full drive, in logarithms, and its R² in drive.

    (2.2, nan-free 0) with fewer than two inner samples: the gamma is then assumed.
    """
    inner = (codes > 0.02) & (codes < 0.999) & (drive > 1e-4)
    if inner.sum() < 2:
        return ASSUMED_GAMMA, 0.0
    x, y = np.log(codes[inner]), np.log(drive[inner])
    # Weighted by drive: the error in drive is what shows, not that of its logarithm.
    weight = drive[inner]
    gamma = float((weight * x * y).sum() / (weight * x * x).sum())
    scatter = ((drive - drive.mean()) ** 2).sum()
    return gamma, float(1 - ((drive - codes**gamma) ** 2).sum() / scatter)


def _gamma_matrix(measured: Measurements, black: Float64Array) -> GammaMatrix:
    gammas = [gamma_fit(*_shape_samples(measured, index, black))[0] for index in range(3)]
    return GammaMatrix(np.array(gammas), primaries(measured, black), black)


def _gamma_plain(measured: Measurements) -> DisplayModel:
    return _gamma_matrix(measured, np.zeros(3))


def _gamma_black(measured: Measurements) -> DisplayModel:
    return _gamma_matrix(measured, measured.black_XYZ)


def _gain_offset_gamma(measured: Measurements) -> DisplayModel:
    """Threshold by search for the best regression of gamma."""
    black = measured.black_XYZ
    gammas, thresholds = np.empty(3), np.empty(3)
    for index in range(3):
        codes, drive = _shape_samples(measured, index, black)
        fits = []
        for threshold in np.linspace(-0.2, 0.2, 81):
            scaled = np.maximum((codes - threshold) / (1 - threshold), 0.0)
            gamma = float(np.clip(gamma_fit(scaled, drive)[0], *GAMMA_RANGE))
            fits.append((float(((drive - scaled**gamma) ** 2).sum()), gamma, float(threshold)))
        _, gammas[index], thresholds[index] = min(fits)
    return GainOffsetGamma(gammas, thresholds, primaries(measured, black), black)


def channel_lut(measured: Measurements) -> LutMatrix:
    """Curves from each channel's own ramp."""
    black = measured.black_XYZ
    red, green, blue = (fit_curve(*ramp_drive(measured, index, black)) for index in range(3))
    return LutMatrix((red, green, blue), primaries(measured, black), black)


def grey_lut(measured: Measurements) -> LutMatrix:
    """Curves from the grey ramp through the inverse of the primaries (Diaz-Barrancas et al. 2024)."""
    black = measured.black_XYZ
    matrix = primaries(measured, black)
    codes = measured.codes[measured.grey].mean(axis=1)
    drive = (measured.XYZ[measured.grey] - black) @ np.linalg.inv(matrix).T
    red, green, blue = (fit_curve(codes, drive[:, index]) for index in range(3))
    return LutMatrix((red, green, blue), matrix, black)


def _corrected_grey(measured: Measurements) -> DisplayModel:
    return _corrected(measured, grey_lut(measured))


def _corrected_channel(measured: Measurements) -> DisplayModel:
    return _corrected(measured, channel_lut(measured))


def _corrected(measured: Measurements, base: LutMatrix) -> DisplayModel:
    return fit_correction(base, measured.codes, measured.XYZ, measured.white_XYZ, measured.mixed)


def _shape_samples(measured: Measurements, index: int, black: Float64Array) -> tuple[Float64Array, Float64Array]:
    """A channel's ramp; where it has no inner samples, the grey ramp through the inverse matrix."""
    codes, drive = ramp_drive(measured, index, black)
    if ((codes > 0.02) & (codes < 0.999)).sum() >= 2:
        return codes, drive
    grey = measured.grey
    linear = (measured.XYZ[grey] - black) @ np.linalg.inv(primaries(measured, black)).T
    return measured.codes[grey, index], linear[:, index] / linear[:, index].max()


# Simplest first: `characterise` takes the first that is within noise of the best.
MODEL_KINDS = (
    ModelKind("gamma-matrix", _gamma_plain),
    ModelKind("gamma-matrix-black", _gamma_black),
    ModelKind("gain-offset-gamma", _gain_offset_gamma, greys=4),
    ModelKind("channel-lut", channel_lut, ramp=4),
    ModelKind("grey-lut", grey_lut, greys=5),
    ModelKind("channel-lut-corrected", _corrected_channel, ramp=4, mixed=20),
    ModelKind("grey-lut-corrected", _corrected_grey, greys=5, mixed=20),
)
