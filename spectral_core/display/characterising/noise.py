"""An instrument's noise, put on readings that have none."""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array

_LEAST_Y_SHARE = 1e-3


def noisy(XYZ: Float64Array, noise: tuple[float, float], rng: np.random.Generator) -> Float64Array:
    """Readings (n, 3) of XYZ (n, 3) by an instrument of these standard deviations of ln Y and of x and y."""
    total = np.maximum(XYZ.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    moved = XYZ[:, :2] / total + rng.normal(0, noise[1], (len(XYZ), 2))
    share = np.column_stack([moved, 1 - moved.sum(axis=1)])
    luminance = XYZ[:, 1:2] * np.exp(rng.normal(0, noise[0], (len(XYZ), 1)))
    return np.asarray(share / np.maximum(share[:, 1:2], _LEAST_Y_SHARE) * luminance)
