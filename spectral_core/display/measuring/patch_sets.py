"""Sets of patches that put each reading where it says most."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.display.measuring.measurements import SAME_CODE
from spectral_core.standards import XYZ_to_Lab

SMALLEST = 18
_LARGEST_CODE = 255
# Black, white and the primaries: without them there is no profile.
_ANCHORS = np.array([[0, 0, 0], [1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
# Mixes that a smooth correction needs; a set that cannot have them gets channel ramps instead, which
# on a power-limited headset halve the error of 30 patches without a correction (dE00 1.5 against 2.9).
_CORRECTED_MIXES, _FEWEST_MIXES = 20, 10
# One patch in five is grey: 8 to 15 of 60 do alike, more and fewer worse. Channel ramps begin to help
# where there are mixes enough.
_GREY_SHARE, _RAMP_SHARE, _RAMPS_FROM = 5, 15, 100
# In CIELAB: over this length readings tell of each other; half that of the gamut's lightness.
_LENGTH = 40.0
_READING_VARIANCE = 1e-2
_CANDIDATES = 1000
_SEED = 20
Colours = Callable[[Float64Array], Float64Array]


def starting_set(count: int, colours: Colours) -> Float64Array:
    """`count` distinct codes (n, 3) to begin with, at least `SMALLEST`; `colours` gives XYZ of codes."""
    fixed = _ramps_and_greys(count)
    return np.concatenate([fixed, best_mixes(fixed, count - len(fixed), colours)])


def extension(measured: Float64Array, count: int, colours: Colours) -> Float64Array:
    """`count` codes (n, 3) to measure next, none of which was measured.

    What a set of the whole size would have and the measured one lacks, up to half of `count`; then mixes.
    """
    wanted = _ramps_and_greys(max(len(measured) + count, SMALLEST))
    lacking = wanted[~_near(wanted, measured)][: max(count // 2, len(_ANCHORS))][:count]
    known = np.concatenate([measured, lacking])
    return np.concatenate([lacking, best_mixes(known, count - len(lacking), colours)])


def best_mixes(known: Float64Array, count: int, colours: Colours) -> Float64Array:
    """`count` mixes (n, 3) that one after the other take the most predictive variance away.

    A Gaussian process over CIELAB, conditioned on the `known` codes (n, 3), stands for what is not
    known of the display; the next mix is the one whose reading lowers the variance, summed over the
    gamut, the most (Seo et al. 2000, "active learning Cohn").
    """
    if count <= 0:
        return np.zeros((0, 3))
    rng = np.random.default_rng(_SEED)
    candidates = np.unique(rng.integers(0, _LARGEST_CODE + 1, (max(_CANDIDATES, 4 * count), 3)), axis=0) / _LARGEST_CODE
    mixed = (np.ptp(candidates, axis=1) > SAME_CODE) & ((candidates > SAME_CODE).sum(axis=1) > 1)
    candidates = candidates[mixed & ~_repeats(candidates, known)]
    white = colours(np.ones((1, 3)))[0]
    at, given = XYZ_to_Lab(colours(candidates), white), XYZ_to_Lab(colours(known), white)
    across = _kernel(at, given)
    within = _kernel(given, given) + _READING_VARIANCE * np.eye(len(given))
    covariance = _kernel(at, at) - across @ np.linalg.solve(within, across.T)
    chosen: list[int] = []
    for _ in range(count):
        gain = (covariance**2).sum(axis=0) / (np.diag(covariance) + _READING_VARIANCE)
        gain[chosen] = -1.0
        best = int(gain.argmax())
        chosen.append(best)
        column = covariance[:, best].copy()
        covariance -= np.outer(column, column / (column[best] + _READING_VARIANCE))
    return np.asarray(candidates[chosen])


def _ramps_and_greys(count: int) -> Float64Array:
    """The codes (n, 3) of a set of `count` that are no mixes."""
    spare = count - len(_ANCHORS)
    if spare < _CORRECTED_MIXES + 5:
        greys, ramp = 3, (spare - 3 - _FEWEST_MIXES) // 3
    else:
        greys = min(count // _GREY_SHARE, spare - _CORRECTED_MIXES)
        ramp = count // _RAMP_SHARE if count >= _RAMPS_FROM else 0
    ramps = [axis * _levels(min(ramp, 50))[:, None] for axis in np.eye(3)]
    return np.concatenate([_ANCHORS, _grey(_levels(min(greys, 50))), *ramps])


def _levels(count: int) -> Float64Array:
    """8-bit codes (count,) evenly between black and full drive."""
    return np.asarray(np.round(np.linspace(0, _LARGEST_CODE, count + 2)[1:-1]) / _LARGEST_CODE)


def _grey(levels: Float64Array) -> Float64Array:
    return np.repeat(levels[:, None], 3, axis=1)


def _kernel(a: Float64Array, b: Float64Array) -> Float64Array:
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.asarray(np.exp(-np.maximum(squared, 0.0) / (2 * _LENGTH**2)))


def _repeats(codes: Float64Array, known: Float64Array) -> BoolArray:
    """True (n,) where a code was measured."""
    return np.asarray((np.abs(codes[:, None] - known) < SAME_CODE).all(axis=2).any(axis=1))


def _near(codes: Float64Array, known: Float64Array) -> BoolArray:
    """True (n,) for anchors that were measured, and levels nearer to a measured one than half their step."""
    step = 1 / (np.sqrt(len(codes)) * 2)
    inner = ~_repeats(codes, _ANCHORS)
    distance = np.abs(codes[:, None] - known).max(axis=2).min(axis=1)
    return np.asarray(distance < np.where(inner, step / 2, SAME_CODE))
