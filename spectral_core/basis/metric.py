"""CIEDE2000 near colours, as a quadratic form: what makes a fit of it a problem of least squares."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array

# Steps of the differences, relative to the colour and, for dark ones, to the white: dE00 of about 0.05, far above
# rounding and far below where the form bends.
_STEP = 1e-3
_DARKEST = 1e-3
# Colours whose difference is computed at a time: what is in between stays in the cache.
BLOCK = 4096


def differences(XYZ_a: Float64Array, XYZ_b: Float64Array, whites: Float64Array) -> Float64Array:
    """dE00 (n, lights) of two arrays of XYZ (n, lights, 3) seen under whites (lights, 3)."""
    result = np.empty(XYZ_a.shape[:-1])
    for first in range(0, len(result), BLOCK):
        rows = slice(first, first + BLOCK)
        result[rows] = standards.delta_E_2000(lab(XYZ_a[rows], whites), lab(XYZ_b[rows], whites))
    return result


def lab(XYZ: Float64Array, whites: Float64Array) -> Float64Array:
    """L*a*b* (n, lights, 3) of XYZ (n, lights, 3) under whites (lights, 3): of all lights in one call, for L*a*b* is
    a function of the ratios to the white.
    """
    return standards.XYZ_to_Lab(XYZ / whites, np.ones(3))


def local_metric(XYZ: Float64Array, whites: Float64Array) -> Float64Array:
    """G (n, lights, 3, 3) with dE00 = sqrt(d' G d) for small differences d of XYZ (n, lights, 3).

    From differences in six directions by polarisation; directions that rounding made imaginary have no weight.
    """
    step = _STEP * np.maximum(np.abs(XYZ), _DARKEST * whites)
    at = lab(XYZ, whites)

    def squared(*axes: int) -> Float64Array:
        moved = XYZ.copy()
        moved[..., axes] += step[..., axes]
        return np.asarray(standards.delta_E_2000(at, lab(moved, whites)) ** 2)

    result = np.empty((*XYZ.shape, 3))
    for axis in range(3):
        result[..., axis, axis] = squared(axis)
    for one, other in combinations(range(3), 2):
        mixed = (squared(one, other) - result[..., one, one] - result[..., other, other]) / 2
        result[..., one, other] = result[..., other, one] = mixed
    result /= step[..., :, None] * step[..., None, :]
    values, vectors = np.linalg.eigh(result)
    return np.asarray((vectors * np.maximum(values, 0.0)[..., None, :]) @ vectors.swapaxes(-1, -2))
