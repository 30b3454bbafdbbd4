"""Tone curves: strictly rising tables from code to linear drive, exactly invertible."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, IntArray, frozen
from spectral_core.errors import DisplayError

# Between neighbouring nodes the curve is a line: with 1025 nodes its error on a gamma of 2.4 is
# below 1e-6 of white.
NODES = 1025
# Interpolation runs on values to this power, where display curves are nearly straight.
_COMPRESSION = 1 / 2.4
_SMALLEST_STEP = 1e-9
# A curve of a file: a flatter one has no inverse in numbers, and full drive is about 1.
_LEAST_RISE, _LARGEST_DRIVE = 1e-12, 100.0
# Places of the table that an inverse starts from: finer than the nodes where a display's curve is steepest.
_GUESSES = 8192
_LENGTHS = (0.03, 0.06, 0.12, 0.25, 0.5)
# A power law and its residual need a few samples to be judged.
_FEWEST_SMOOTHED = 6
_RIDGES = (1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)


@dataclass(frozen=True)
class ToneCurve:
    """A rising curve from code 0 (drive 0) to code 1, piecewise linear on even nodes.

    Beyond the ends it continues: below 0 by odd symmetry, above 1 with its last slope, so that both
    directions are defined for all real numbers.
    """

    values: Float64Array

    def __post_init__(self) -> None:
        values = frozen(self.values)
        if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all() or values[0] != 0:
            raise DisplayError("a tone curve must be a list of finite numbers from 0", remedy="correct the profile")
        if not (np.diff(values) > _LEAST_RISE).all():
            raise DisplayError("a tone curve must rise", remedy="correct the profile")
        if values[-1] > _LARGEST_DRIVE:
            raise DisplayError("a tone curve must end near 1", remedy="correct the profile")
        object.__setattr__(self, "values", values)

    def forward(self, codes: FloatArray) -> Float64Array:
        """Linear drive of codes, any shape."""
        size: Float64Array = np.abs(np.asarray(codes, dtype=np.float64))
        at = size * self._segments
        return np.asarray(np.copysign(_on_lines(self._lines, _whole(at, self._segments - 1), at), codes))

    def inverse(self, drive: FloatArray) -> Float64Array:
        """Codes of linear drive, any shape."""
        size: Float64Array = np.abs(np.asarray(drive, dtype=np.float64))
        return np.asarray(np.copysign(_on_lines(self._inverse_lines, self._segment(size), size), drive))

    def _segment(self, size: Float64Array) -> IntArray:
        """Where drives lie: read from a table over their square root, then moved up if beyond its end.

        Reading takes a tenth of the time of a binary search.
        """
        guesses, scale, moves = self._guesses
        place = np.sqrt(size)
        place *= scale
        segment = np.take(guesses, _whole(place, len(guesses) - 1), mode="clip")
        for _ in range(moves):
            segment += size >= np.take(self._ends, segment, mode="clip")
        return np.asarray(segment)

    @property
    def _segments(self) -> int:
        return len(self.values) - 1

    @cached_property
    def _lines(self) -> tuple[Float64Array, Float64Array]:
        """Slope and value at 0 of each segment's line, over the number of the segment."""
        steps = np.diff(self.values)
        return steps, self.values[:-1] - np.arange(self._segments) * steps

    @cached_property
    def _inverse_lines(self) -> tuple[Float64Array, Float64Array]:
        """The same from drive to code."""
        steps, starts = self._lines
        return 1 / (steps * self._segments), -starts / (steps * self._segments)

    @cached_property
    def _ends(self) -> Float64Array:
        """Where each segment ends; the last goes on."""
        return np.append(self.values[1:-1], np.inf)

    @cached_property
    def _guesses(self) -> tuple[IntArray, float, int]:
        """The segment at each of many square roots of drive, their scale, and the most ends between two."""
        scale = _GUESSES / float(np.sqrt(self.values[-1]))
        edges = (np.arange(_GUESSES + 1) / scale) ** 2
        # A place is rounded: the first segment that it can mean, and the last.
        first, last = (np.searchsorted(self._ends, edges * (1 + sign * 1e-12), side="right") for sign in (-1, 1))
        return first.astype(np.intp), scale, int((last[1:] - first[:-1]).max())


def _whole(values: Float64Array, largest: int) -> IntArray:
    """Whole numbers of values from 0; what is no number becomes one, and stays none on its line."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.minimum(values, largest).astype(np.intp))


def _on_lines(lines: tuple[Float64Array, Float64Array], chosen: IntArray, at: Float64Array) -> Float64Array:
    slopes, starts = lines
    result = np.take(slopes, chosen, mode="clip")
    result *= at
    result += np.take(starts, chosen, mode="clip")
    return result


def fit_curve(codes: Float64Array, drive: Float64Array) -> ToneCurve:
    """A smooth rising curve through measured (n,) codes and drives.

    Either through the samples (a quiet instrument) or smoothed (a noisy one): whichever predicts
    samples that are left out better. Both work on compressed values; what falls is pooled.
    """
    levels, means = _averaged(codes, np.maximum(drive, 0.0) ** _COMPRESSION)
    nodes = np.linspace(0.0, 1.0, NODES)
    through, through_error = _through(levels, means, nodes)
    smooth, smooth_error = _smooth(levels[1:], means[1:], nodes)
    values = _pool(np.maximum(through if through_error <= smooth_error else smooth, 0.0)) ** (1 / _COMPRESSION)
    values[0] = 0.0
    return ToneCurve(np.maximum.accumulate(values) + _SMALLEST_STEP * np.arange(NODES))


def _averaged(codes: Float64Array, values: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Levels (n,) from 0 and their mean values (n,), repeats averaged; the value at 0 is 0."""
    levels, group = np.unique(np.round(codes, 4), return_inverse=True)
    means = np.bincount(group.ravel(), values) / np.bincount(group.ravel())
    above = levels > 0
    return np.append(0.0, levels[above]), np.append(0.0, means[above])


def _through(levels: Float64Array, means: Float64Array, at: Float64Array) -> tuple[Float64Array, float]:
    """Monotonic cubic (Fritsch and Carlson 1980) through the pooled samples, and its mean squared
    error on inner samples that are left out.
    """
    errors = [
        _monotonic_cubic(np.delete(levels, i), _pool(np.delete(means, i)), levels[i : i + 1])[0] - means[i]
        for i in range(1, len(levels) - 1)
    ]
    error = float(np.mean(np.square(errors))) if errors else 0.0
    return _monotonic_cubic(levels, _pool(means), at), error


def _smooth(x: Float64Array, y: Float64Array, at: Float64Array) -> tuple[Float64Array, float]:
    """A power law, and what it leaves by kernel ridge regression of the smallest leave-one-out
    error; the curve and that error on inner samples.
    """
    if len(x) < _FEWEST_SMOOTHED:
        return np.zeros_like(at), np.inf
    exponent = _power(x, y)
    residual, error = _smoothed(x, y - x**exponent, at)
    curve = at**exponent + residual
    # The curve starts at 0: what the smoothing has there fades out over the first hundredth.
    return curve - curve[0] * np.exp(-((at / 0.01) ** 2)), error


def _power(x: Float64Array, y: Float64Array) -> float:
    """Exponent of y = y(1) x^exponent by regression, 1 with too few samples."""
    usable = (x > 0.02) & (x < 0.999) & (y > 1e-3)
    if usable.sum() < 2:
        return 1.0
    log_x, log_y = np.log(x[usable]), np.log(y[usable] / y.max())
    return float((y[usable] * log_x * log_y).sum() / (y[usable] * log_x**2).sum())


def _smoothed(x: Float64Array, residual: Float64Array, at: Float64Array) -> tuple[Float64Array, float]:
    """Kernel ridge regression of a residual (n,) at other places, by the smallest leave-one-out error."""
    best: tuple[float, Float64Array] = (np.inf, np.zeros_like(at))
    for length in _LENGTHS:
        kernel = np.exp(-(((x[:, None] - x) / length) ** 2) / 2)
        towards = np.exp(-(((at[:, None] - x) / length) ** 2) / 2)
        for ridge in _RIDGES:
            inverse = np.linalg.inv(kernel + ridge * np.eye(len(x)))
            weights = inverse @ residual
            error = float(((weights / np.diag(inverse)) ** 2)[:-1].mean())
            if error < best[0]:
                best = (error, towards @ weights)
    return best[1], best[0]


def _monotonic_cubic(x: Float64Array, y: Float64Array, at: Float64Array) -> Float64Array:
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    slopes = np.concatenate([d[:1], np.zeros(len(x) - 2), d[-1:]])
    rising = (d[:-1] > 0) & (d[1:] > 0)
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    safe = np.where(rising[:, None], np.stack([d[:-1], d[1:]], axis=1), 1.0)
    slopes[1:-1] = np.where(rising, (w1 + w2) / (w1 / safe[:, 0] + w2 / safe[:, 1]), 0.0)
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    t = (at - x[i]) / h[i]
    return np.asarray(
        y[i] * (1 + 2 * t) * (1 - t) ** 2
        + y[i + 1] * t**2 * (3 - 2 * t)
        + h[i] * slopes[i] * t * (1 - t) ** 2
        + h[i] * slopes[i + 1] * t**2 * (t - 1)
    )


def _pool(values: Float64Array) -> Float64Array:
    """The nearest non-falling sequence."""
    blocks: list[tuple[float, int]] = []
    for value in values:
        blocks.append((float(value), 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (a, n), (b, m) = blocks[-2], blocks[-1]
            blocks[-2:] = [((a * n + b * m) / (n + m), n + m)]
    return np.repeat([value for value, _ in blocks], [count for _, count in blocks])
