"""Mixtures of spectra that reproduce a colour and change smoothly with it.

Of all mixtures ``w >= 0, sum w = 1`` of a colour's neighbours the one is taken that minimises

    sum w^2 / 2k  +  |r|^2 / 2 epsilon,

r being the difference between its colour and the wanted one, in units near to those of CIEDE2000 and
relative to how far the nearest neighbour is. The priors k are the weights of modified Shepard
interpolation (Franke & Nielson 1980): with them the mixture is a library's own spectrum where the colour is
that spectrum's, and a spectrum fades to nothing where it stops being one of the neighbours. The objective is
strictly convex, so that its minimum changes continuously with the colour. It is found in its dual, which has
four unknowns. With y the neighbours' differences from the wanted colour, ``w = k max(0, m + l y)``, where
m and l minimise ``sum k max(0, m + l y)^2 / 2 + epsilon |l|^2 / 2 - m``, which is piecewise quadratic; then
``r = -epsilon l``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray

# Where a mixture can reproduce a colour, it does within some hundredths of how far the nearest spectrum is. Much
# smaller, and mixtures turn sharper corners.
_EPSILON = 1e-3
_STEPS = 100
_SETTLED = 1e-8
_HALVINGS = 20
# A colour nearer than this to a spectrum's is that spectrum's.
_SAME = 1e-6
_NEAR = 1e-3
# Of the dual's unknowns: the first is that of the weights' sum.
_OF_SUM, _OF_COLOUR = np.array([1.0, 0, 0, 0]), np.array([0.0, 1, 1, 1])
_RIDGE = np.diag([1e-12, _EPSILON, _EPSILON, _EPSILON])
_COLOURS = 1 << 14
# CIE 15:2018, 8.2.1: below it the cube root is a line.
_TOE = (6 / 29) ** 3


def mixtures(
    XYZ: Float64Array, white: Float64Array, neighbours_XYZ: Float64Array, dE00: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Weights (n, count) of neighbours for colours, and the mixtures' dE00 (n,), never more than the nearest's.

    Parameters
    ----------
    XYZ, white
        The colours (n, 3) and their white (3,), Y = 1.
    neighbours_XYZ
        (n, count, 3), the nearest first.
    dE00
        (n, count) or (n, count + 1): how far they are, and how far the next one is.
    """
    weights, reached = np.empty(neighbours_XYZ.shape[:2]), np.empty(len(XYZ))

    def one(first: int) -> None:
        part = slice(first, first + _COLOURS)
        weights[part], reached[part] = _mixtures(XYZ[part], white, neighbours_XYZ[part], dE00[part])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(one, range(0, len(XYZ), _COLOURS)))
    return weights, reached


def _mixtures(
    XYZ: Float64Array, white: Float64Array, neighbours_XYZ: Float64Array, dE00: Float64Array
) -> tuple[Float64Array, Float64Array]:
    differences = np.einsum("nij,nkj->nki", _metric(XYZ, white), neighbours_XYZ - XYZ[:, None])
    differences /= np.maximum(dE00[:, 0], _NEAR)[:, None, None]
    weights = _weights(_priors(dE00, differences.shape[1]), differences)
    Lab = standards.XYZ_to_Lab(XYZ, white)

    def reached(which: IntArray, weights: Float64Array) -> Float64Array:
        mixed = np.einsum("nk,nkj->nj", weights, neighbours_XYZ[which])
        return standards.delta_E_2000(Lab[which], standards.XYZ_to_Lab(mixed, white))

    everything = np.arange(len(XYZ))
    distance = reached(everything, weights)
    worse = np.flatnonzero(distance > dE00[:, 0])
    if len(worse):
        gathered = _gathered(weights[worse], dE00[worse], lambda w: reached(worse, w))
        weights[worse], distance[worse] = gathered, np.minimum(reached(worse, gathered), dE00[worse, 0])
    return weights, distance


def _priors(dE00: Float64Array, count: int) -> Float64Array:
    """(n, count), the largest of each colour 1."""
    near = dE00[:, :count] + _SAME
    priors = 1 / near
    if dE00.shape[1] > count:
        priors = np.maximum(priors - 1 / (dE00[:, count, None] + _SAME), 0.0)
    priors = priors**2
    largest = priors.max(axis=1, keepdims=True)
    # All neighbours just as far as the next one: none is preferred.
    return np.where(largest > 0, priors / np.where(largest > 0, largest, 1.0), 1.0)


def _metric(XYZ: Float64Array, white: Float64Array) -> Float64Array:
    """(n, 3, 3) from small differences in XYZ to lightness, chroma and hue about as CIEDE2000 weighs them."""
    ratio = XYZ / white
    slope = np.where(ratio > _TOE, np.cbrt(np.maximum(ratio, _TOE)) ** -2, _TOE ** (-2 / 3)) / 3 / white
    Lab = standards.XYZ_to_Lab(XYZ, white)
    to_Lab = np.array([[0.0, 116, 0], [500, -500, 0], [0, 200, -200]]) * slope[:, None, :]
    chroma = np.hypot(Lab[:, 1], Lab[:, 2])
    along = np.divide(Lab[:, 1:], chroma[:, None], out=np.tile([1.0, 0.0], (len(XYZ), 1)), where=chroma[:, None] > 0)
    off = (Lab[:, 0] - 50) ** 2
    weigh = np.zeros((len(XYZ), 3, 3))
    weigh[:, 0, 0] = 1 / (1 + 0.015 * off / np.sqrt(20 + off))
    weigh[:, 1, 1:] = along / (1 + 0.045 * chroma)[:, None]
    weigh[:, 2, 1:] = np.stack([-along[:, 1], along[:, 0]], axis=1) / (1 + 0.015 * chroma)[:, None]
    return np.asarray(weigh @ to_Lab)


def _weights(priors: Float64Array, differences: Float64Array) -> Float64Array:
    """The weights (n, count) of differences in units of the nearest one's, by Newton's method in the dual."""
    ones = np.ones((*priors.shape, 1))
    columns = np.concatenate([ones, differences], axis=2)
    unknown = np.zeros((len(priors), 4))
    unknown[:, 0] = 1 / priors.sum(axis=1)
    active = np.arange(len(priors))
    for _ in range(_STEPS):
        c, k, x = columns[active], priors[active], unknown[active]
        value, weights, gradient = _dual(c, k, x)
        moving = np.abs(gradient).max(axis=1) > _SETTLED
        if not moving.any():
            break
        active, c, k, x, value, weights, gradient = (
            each[moving] for each in (active, c, k, x, value, weights, gradient)
        )
        curvature = (np.where(weights > 0, k, 0.0)[..., None] * c).transpose(0, 2, 1) @ c + _RIDGE
        step = -np.linalg.solve(curvature, gradient[..., None])[..., 0]
        unknown[active] = x + _size(c, k, x, value, step, (step * gradient).sum(axis=1))[:, None] * step
    weights = _dual(columns, priors, unknown)[1]
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _size(
    c: Float64Array, k: Float64Array, x: Float64Array, value: Float64Array, step: Float64Array, slope: Float64Array
) -> Float64Array:
    """How much (n,) of a step to go: halved until the value falls as it should."""
    size = np.ones(len(x))
    left = np.arange(len(x))
    for _ in range(_HALVINGS):
        reached = _dual(c[left], k[left], x[left] + size[left, None] * step[left])[0]
        left = left[reached > value[left] + 1e-4 * size[left] * slope[left] + 1e-12 * (1 + np.abs(value[left]))]
        if not len(left):
            break
        size[left] /= 2
    return size


def _dual(c: Float64Array, k: Float64Array, x: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """The dual's value (n,), the weights (n, count) that belong to it, and its gradient (n, 4)."""
    pressure = np.maximum((c @ x[..., None])[..., 0], 0.0)
    weights = k * pressure
    gradient = (weights[:, None] @ c)[:, 0] + _EPSILON * _OF_COLOUR * x - _OF_SUM
    value = (weights * pressure).sum(axis=1) / 2 + _EPSILON / 2 * (x[:, 1:] ** 2).sum(axis=1) - x[:, 0]
    return value, weights, gradient


def _gathered(
    weights: Float64Array, dE00: Float64Array, reached: Callable[[Float64Array], Float64Array]
) -> Float64Array:
    """Weights drawn to the nearest ones, just so far that the mixture is no further than the nearest alone.

    The least factor does it, not the nearest alone, which would change at once where two are as near.
    """
    nearest = dE00[:, :1]
    further = (dE00[:, : weights.shape[1]] - nearest) / (nearest + _SAME)

    def drawn(strength: Float64Array) -> Float64Array:
        pulled = weights * np.exp(-np.minimum(strength[:, None] * further, 700.0))
        total = pulled.sum(axis=1, keepdims=True)
        return np.asarray(np.divide(pulled, total, out=np.zeros_like(pulled), where=total > 0))

    low, high = np.zeros(len(weights)), np.full(len(weights), np.inf)
    for strength in 2.0 ** np.arange(-8, 24):
        good = (reached(drawn(np.full(len(weights), strength))) <= nearest[:, 0]) & np.isinf(high)
        high[good] = strength
        low[np.isinf(high)] = strength
    some = np.isfinite(high)
    high[~some] = low[~some] = 0
    for _ in range(30):
        middle = (low + high) / 2
        good = reached(drawn(middle)) <= nearest[:, 0]
        low, high = np.where(good, low, middle), np.where(good, middle, high)
    result = drawn(high)
    result[~some] = np.eye(weights.shape[1])[0]
    return result
