"""Mixtures of spectra that reproduce a colour and change smoothly with it.

Of all mixtures ``w >= 0, sum w = 1`` of a colour's neighbours the one is taken that minimises

    sum w log(w / k)  +  |r|^2 / (2 epsilon),

r being the difference between its colour and the wanted one, in units near to those of CIEDE2000. The
priors k are the weights of modified Shepard interpolation (Franke & Nielson 1980): they make it the
library's own spectrum where the colour is that of a spectrum, and fade to nothing where a spectrum stops being one
of the neighbours. The objective is strictly convex, so that its minimum is a continuous function of the colour. It is
found in its dual, which has three unknowns (as local maximum-entropy shape functions are: Arroyo & Ortiz 2006):
minimise ``log sum k exp(lambda y) + epsilon |lambda|^2 / 2``, with y the neighbours' differences
from the wanted colour; then ``w ~ k exp(lambda y)`` and ``r = -epsilon lambda``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray

# Of residuals in units of dE00: where the mixture can reproduce a colour, it does within some thousandths.
_EPSILON = 1e-3
_STEPS = 100
_SETTLED = 1e-6
_FACTOR = 8.0
_HALVINGS = 20
# A colour nearer than this to a spectrum's is that spectrum's.
_SAME = 1e-6
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
    differences /= (dE00[:, 0] + _SAME)[:, None, None]
    weights = _entropic(_priors(dE00, differences.shape[1]), differences)
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


def _entropic(priors: Float64Array, differences: Float64Array) -> Float64Array:
    """The weights (n, count) of differences in units of the nearest one's, by Newton's method in the dual.

    Epsilon comes down to its value in steps, each from where the one before has led: at once, a colour
    outside of all its neighbours would take hundreds of steps.
    """
    with np.errstate(divide="ignore"):
        logarithm = np.log(priors)
    unknown = np.zeros((len(priors), 3))
    epsilon = np.maximum((differences**2).sum(axis=2).max(axis=1), _EPSILON)
    active = np.arange(len(priors))
    for _ in range(_STEPS):
        y, k, x, e = differences[active], logarithm[active], unknown[active], epsilon[active]
        value, weights = _dual(y, k, x, e)
        mean = np.einsum("nk,nki->ni", weights, y)
        gradient = mean + e[:, None] * x
        left = np.abs(gradient).max(axis=1)
        settled = left <= np.where(e > _EPSILON, 0.1 * e * (1 + np.abs(x).max(axis=1)), _SETTLED)
        moving = ~(settled & (e <= _EPSILON))
        if not moving.any():
            break
        e = np.where(settled, np.maximum(e / _FACTOR, _EPSILON), e)
        epsilon[active] = e
        active, y, k, x, e, weights, mean = (each[moving] for each in (active, y, k, x, e, weights, mean))
        value, gradient = _dual(y, k, x, e)[0], mean + e[:, None] * x
        centred = y - mean[:, None]
        curvature = (weights[..., None] * centred).transpose(0, 2, 1) @ centred + e[:, None, None] * np.eye(3)
        newton = -np.linalg.solve(curvature, gradient[..., None])[..., 0]
        unknown[active] = x + _size(y, k, x, e, value, newton, (newton * gradient).sum(axis=1))[:, None] * newton
    return _dual(differences, logarithm, unknown, epsilon)[1]


def _size(
    y: Float64Array, k: Float64Array, x: Float64Array, e: Float64Array, value: Float64Array, step: Float64Array,
    slope: Float64Array,
) -> Float64Array:  # fmt: skip
    """How much (n,) of a step to go: halved until the value falls as it should."""
    size = np.ones(len(x))
    left = np.arange(len(x))
    for _ in range(_HALVINGS):
        reached = _dual(y[left], k[left], x[left] + size[left, None] * step[left], e[left])[0]
        left = left[reached > value[left] + 1e-4 * size[left] * slope[left] + 1e-12 * (1 + np.abs(value[left]))]
        if not len(left):
            break
        size[left] /= 2
    return size


def _dual(y: Float64Array, k: Float64Array, x: Float64Array, e: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The dual's value (n,), and the weights (n, count) that belong to it."""
    exponent = k + (y @ x[..., None])[..., 0]
    largest = exponent.max(axis=1, keepdims=True)
    weights = np.exp(exponent - largest)
    total = weights.sum(axis=1, keepdims=True)
    return (np.log(total) + largest)[:, 0] + e / 2 * (x**2).sum(axis=1), weights / total


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
