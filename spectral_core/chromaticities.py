"""Chromaticities: CIE 1931 xy and CIE 1976 u'v' of XYZ, and back (CIE 15:2018)."""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray


def XYZ_to_xy(XYZ: FloatArray) -> Float64Array:
    """CIE 1931 x, y (..., 2) of XYZ (..., 3) whose sum is not 0."""
    values = np.asarray(XYZ)
    return np.asarray(values[..., :2] / values.sum(axis=-1, keepdims=True))


def XYZ_to_uv(XYZ: FloatArray) -> Float64Array:
    """CIE 1976 u', v' (..., 2) of XYZ (..., 3) that is the light of something."""
    values = np.asarray(XYZ)
    weight = values @ np.array([1.0, 15.0, 3.0])
    return np.asarray(values[..., :2] * np.array([4.0, 9.0]) / weight[..., None])


def xyY_to_XYZ(xyY: FloatArray) -> Float64Array:
    """XYZ (..., 3) of x, y, Y (..., 3); no light, Y = 0, may leave y at 0."""
    x, y, Y = np.moveaxis(np.asarray(xyY), -1, 0)
    safe = np.where((y == 0) & (Y == 0), 1.0, y)
    return np.stack([x / safe * Y, Y, (1 - x - y) / safe * Y], axis=-1)


def xy_to_uv(xy: FloatArray) -> Float64Array:
    """CIE 1976 u', v' (..., 2) of x, y (..., 2)."""
    x, y = xy[..., 0], xy[..., 1]
    return np.asarray(np.stack([4 * x, 9 * y], axis=-1) / (-2 * x + 12 * y + 3)[..., None])


def uv_to_xy(uv: FloatArray) -> Float64Array:
    """CIE 1931 x, y (..., 2) of u', v' (..., 2)."""
    u, v = uv[..., 0], uv[..., 1]
    return np.asarray(np.stack([9 * u, 4 * v], axis=-1) / (6 * u - 16 * v + 12)[..., None])
