"""Simulated displays whose truth is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.measuring.measurements import Measurements

Display = Callable[[Float64Array], Float64Array]
GAMMA = np.array([2.35, 2.30, 2.25])
BLACK = np.array([0.02, 0.02, 0.03])
# x, y and luminance of the primaries at full drive alone; they sum to 130.
PRIMARIES = ((0.66, 0.33, 29.0), (0.23, 0.70, 92.0), (0.14, 0.05, 9.0))


def xyY_to_XYZ(xyY: Float64Array) -> Float64Array:
    x, y, Y = np.moveaxis(np.asarray(xyY, dtype=np.float64), -1, 0)
    return np.stack([x / y * Y, Y, (1 - x - y) / y * Y], axis=-1)


MATRIX = xyY_to_XYZ(np.array(PRIMARIES)).T


def additive(codes: Float64Array) -> Float64Array:
    """The published model itself."""
    return np.asarray(codes**GAMMA @ MATRIX.T + BLACK)


def power_limited(codes: Float64Array) -> Float64Array:
    """An OLED that dims all channels as their common load grows.

    The load is the luminance the picture would have, over that of all channels; the dimming
    1 / (1 + 0.51 load²) makes red, green and blue alone sum to 30 % more than white.
    """
    linear = codes**GAMMA
    load = linear @ MATRIX[1] / MATRIX[1].sum()
    return np.asarray((linear @ MATRIX.T) / (1 + 0.51 * load**2)[:, None] + BLACK)


def published_protocol(seed: int = 0) -> Float64Array:
    """234 codes: ramps of each channel in steps of 5, a grey ramp, colours at random (Diaz-Barrancas
    et al. 2020, section 2.1)."""
    steps = np.arange(5, 256, 5) / 255
    ramps = [np.eye(3)[channel] * step for channel in range(3) for step in steps]
    greys = [np.full(3, level) for level in np.linspace(0, 1, 14)]
    count = 234 - len(ramps) - len(greys)
    mixed = np.random.default_rng(seed).uniform(0, 1, (count, 3)).round(3)
    return np.concatenate([ramps, greys, mixed])


def measure(display: Display, codes: Float64Array, seed: int | None = None) -> Measurements:
    """Readings of a display; with a seed, by an instrument of 1 % in luminance and 0.0015 in x and y."""
    XYZ = display(codes)
    if seed is not None:
        rng = np.random.default_rng(seed)
        total = XYZ.sum(axis=1)
        xyY = np.stack([XYZ[:, 0] / total, XYZ[:, 1] / total, XYZ[:, 1]], axis=1)
        xyY[:, :2] += rng.normal(0, 0.0015, (len(codes), 2))
        xyY[:, 2] *= 1 + rng.normal(0, 0.01, len(codes))
        XYZ = xyY_to_XYZ(xyY)
    return Measurements(frozen(codes), frozen(XYZ), "cd/m2")
