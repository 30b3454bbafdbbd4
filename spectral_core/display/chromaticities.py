"""Chromaticities of XYZ."""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray


def xy(XYZ: FloatArray) -> Float64Array:
    """CIE 1931 xy (..., 2) of XYZ (..., 3) whose sum is above 0."""
    values = np.asarray(XYZ)
    return np.asarray(values[..., :2] / values.sum(axis=-1, keepdims=True))


def uv(XYZ: FloatArray) -> Float64Array:
    """CIE 1976 u'v' (..., 2) of XYZ (..., 3) that is the light of something."""
    values = np.asarray(XYZ)
    weight = values @ np.array([1.0, 15.0, 3.0])
    return np.asarray(values[..., :2] * np.array([4.0, 9.0]) / weight[..., None])
