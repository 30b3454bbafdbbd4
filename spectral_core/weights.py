"""Weighting factors: all spectral work of a light, an observer and a band grid in one matrix.

``XYZ = reflectance @ W`` with ``W`` of shape (bands, 3), after the idea of ASTM E308 and E2022:
resample the weights, never the texture. A light is a list of (wavelength, power) nodes, so that
tables are summed at their own samples and spectral lines are exact. The reflectance's
interpolation to the nodes is linear in its samples and folded into ``W``.

Interpolation is the cubic spline with not-a-knot ends. Measured against linear interpolation
(``benchmarks/weighting_factors.py``) it is about five to twenty times more accurate at 4 and
5 nm; it reproduces cubic polynomials exactly on any grid, even or not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from spectral_core.arrays import Float64Array, IntArray, frozen
from spectral_core.errors import LightError, SpectrumError
from spectral_core.standards import DEFAULT_OBSERVER, observer_table

# The spline's operator is dense, bands by bands: this many take a second and half a gigabyte.
LARGEST_BANDS = 4000
# Operators that are kept for the next light: 2 MB each.
_LARGEST_KEPT = 512
NOTABLE_EXTENSION = 1e-4
# Even grids stay below 2, grids of 10 nm with each band up to 4 nm off its place below 2.6.
NOTABLE_AMPLIFICATION = 3.0
# A good camera's noise of 0.2 % would become 5 % of the white.
LARGEST_AMPLIFICATION = 25.0


@dataclass(frozen=True)
class WeightingFactors:
    """Weighting factors of one light, observer and band grid.

    Attributes
    ----------
    matrix
        (bands, 3), in the order of `wavelengths_nm`; XYZ with Y = 1 for the perfect diffuser.
    wavelengths_nm
        (bands,), as they were given.
    white_XYZ
        (3,), XYZ of the perfect diffuser, Y = 1.
    extended_below, extended_above
        Share of the white's tristimulus values (largest of X, Y, Z) that lies beyond the first
        and the last band and is taken from the end bands, the extension of ASTM E308.
    """

    matrix: Float64Array
    wavelengths_nm: Float64Array
    white_XYZ: Float64Array
    extended_below: float
    extended_above: float

    @property
    def extended(self) -> float:
        """Share of the white that rests on extended ends, 0 to 1."""
        return self.extended_below + self.extended_above

    @property
    def amplification(self) -> float:
        """How many times an error of all bands reaches X, Y or Z, each relative to the white's, at worst.

        1 for weights that are all positive, up to 2 for even grids of 2 to 80 nm under all built-in lights.
        It grows with the ratio of neighbouring distances: a narrow one makes slopes of errors, a wide one
        beside it carries them far.
        """
        size = np.abs(self.matrix).sum(axis=0)
        return float(np.divide(size, self.white_XYZ, out=np.zeros(3), where=self.white_XYZ > 0).max())

    def warnings(self, extension: float = NOTABLE_EXTENSION) -> list[str]:
        """What rests on bands that were never measured, from a share of `extension` of the white on, or on
        differences of bands that lie close together.
        """
        found = []
        low, high = self.wavelengths_nm.min(), self.wavelengths_nm.max()
        if self.extended >= extension:
            found.append(
                f"bands from {low:g} to {high:g} nm: {self.extended_below:.2%} below and {self.extended_above:.2%} "
                "above of the white's X, Y or Z rest on the repeated end values (ASTM E308)"
            )
        if self.amplification > NOTABLE_AMPLIFICATION:
            found.append(
                f"errors of single bands reach the colours up to {self.amplification:.1f} times: around "
                f"{self.most_weighted_nm:g} nm bands lie much closer together than those beside them"
            )
        return found

    @property
    def most_weighted_nm(self) -> float:
        """Wavelength of the band with the largest weight."""
        return float(self.wavelengths_nm[np.argmax(np.abs(self.matrix).max(axis=1))])


def quadrature_widths(wavelengths_nm: Float64Array) -> Float64Array:
    """Width in nm that each sample (n,) of an ascending table stands for.

    Half way to each neighbour, symmetric at the ends: for an even table the step itself, so that
    integrals are sums at the table's own samples. That is what the published chromaticities of
    the CIE illuminants rest on (CIE 015:2018).
    """
    if len(wavelengths_nm) < 2:
        return np.ones_like(wavelengths_nm)
    gaps = np.diff(wavelengths_nm)
    return np.asarray((np.concatenate([gaps[:1], gaps]) + np.concatenate([gaps, gaps[-1:]])) / 2)


@cache
def _observer_slopes(observer: str) -> Float64Array:
    wavelengths, values = observer_table(observer)
    return _spline_slope_operator(wavelengths) @ values


def colour_matching(wavelengths_nm: Float64Array, observer: str = DEFAULT_OBSERVER) -> Float64Array:
    """Colour-matching functions (n, 3) at any wavelengths (n,); zero outside the observer's table.

    Between the 1 nm samples by cubic spline; at them, the table.
    """
    table_nm, values = observer_table(observer)
    wavelengths = np.asarray(wavelengths_nm, dtype=np.float64)
    inside = (wavelengths >= table_nm[0]) & (wavelengths <= table_nm[-1])
    result = np.zeros((len(wavelengths), 3))
    at = wavelengths[inside]
    index, basis = _hermite(table_nm, at)
    slopes = _observer_slopes(observer)
    result[inside] = (
        basis[:, 0, None] * values[index]
        + basis[:, 1, None] * values[index + 1]
        + basis[:, 2, None] * slopes[index]
        + basis[:, 3, None] * slopes[index + 1]
    )
    return result


def light_XYZ(wavelengths_nm: Float64Array, powers: Float64Array, observer: str = DEFAULT_OBSERVER) -> Float64Array:
    """XYZ (3,) with Y = 1 of a light's nodes: wavelengths (n,) and powers (n,).

    Raises
    ------
    LightError
        If the light has no luminance.
    """
    XYZ = np.asarray(powers, dtype=np.float64) @ colour_matching(wavelengths_nm, observer)
    if not XYZ[1] > 0:
        raise LightError("the light has no luminance", remedy="give a spectrum with power between 380 and 780 nm")
    return np.asarray(XYZ / XYZ[1])


def weighting_factors(
    light_nm: Float64Array,
    light_powers: Float64Array,
    bands_nm: Float64Array,
    observer: str = DEFAULT_OBSERVER,
    interpolation: str = "cubic",
) -> WeightingFactors:
    """Weighting factors of a light's nodes for reflectance sampled at `bands_nm`.

    Parameters
    ----------
    light_nm, light_powers
        (nodes,), the light's wavelengths and powers (power already times its quadrature width).
    bands_nm
        (bands,), distinct, in any order and spacing.
    observer
        A key of `spectral_core.standards.OBSERVERS`.
    interpolation
        ``"cubic"`` (not-a-knot spline) or ``"linear"``, kept for comparison.

    Raises
    ------
    SpectrumError
        If bands repeat, are not finite or more than `LARGEST_BANDS`, or the interpolation is unknown.
    LightError
        If the light has no luminance.
    """
    bands = np.asarray(bands_nm, dtype=np.float64)
    order = _checked_order(bands)
    nodes = np.asarray(light_nm, dtype=np.float64)
    per_node = np.asarray(light_powers, dtype=np.float64)[:, None] * colour_matching(nodes, observer)
    luminance = per_node[:, 1].sum()
    if not luminance > 0:
        raise LightError("the light has no luminance", remedy="give a spectrum with power between 380 and 780 nm")
    per_node = per_node / luminance
    white = per_node.sum(axis=0)
    matrix = np.empty((len(bands), 3))
    matrix[order] = interpolation_operator(bands[order], nodes, interpolation).T @ per_node
    share = np.divide(per_node, white, out=np.zeros_like(per_node), where=white > 0)
    return WeightingFactors(
        matrix=frozen(matrix),
        wavelengths_nm=frozen(bands),
        white_XYZ=frozen(white),
        extended_below=float(share[nodes < bands.min()].sum(axis=0).max()),
        extended_above=float(share[nodes > bands.max()].sum(axis=0).max()),
    )


def interpolation_operator(source_nm: Float64Array, target_nm: Float64Array, kind: str = "cubic") -> Float64Array:
    """Linear operator (targets, sources) from samples at ascending `source_nm` to `target_nm`.

    Beyond the ends it repeats the end samples. With fewer than four samples the cubic becomes the
    polynomial through all of them.
    """
    source = np.asarray(source_nm, dtype=np.float64)
    target = np.asarray(target_nm, dtype=np.float64)
    clamped = np.clip(target, source[0], source[-1])
    count = len(source)
    if count == 1:
        return np.ones((len(target), 1))
    index, basis = _hermite(source, clamped)
    rows = np.arange(len(target))
    operator = np.zeros((len(target), count))
    if kind == "linear":
        fraction = (clamped - source[index]) / (source[index + 1] - source[index])
        operator[rows, index] = 1 - fraction
        operator[rows, index + 1] += fraction
        return operator
    if kind != "cubic":
        raise SpectrumError(f"no interpolation '{kind}'", remedy="use cubic or linear")
    operator[rows, index] = basis[:, 0]
    operator[rows, index + 1] += basis[:, 1]
    slopes = _spline_slope_operator(source)
    return np.asarray(operator + basis[:, 2, None] * slopes[index] + basis[:, 3, None] * slopes[index + 1])


def _checked_order(bands: Float64Array) -> IntArray:
    if bands.ndim != 1 or len(bands) == 0 or not np.all(np.isfinite(bands)):
        raise SpectrumError(
            "band wavelengths must be a list of finite numbers", remedy="give one wavelength in nm per band"
        )
    if len(bands) > LARGEST_BANDS:
        raise SpectrumError(
            f"{len(bands)} bands, more than {LARGEST_BANDS}", remedy="average neighbouring ones: 1 nm is plenty"
        )
    order = np.argsort(bands)
    repeated = bands[order][:-1][np.diff(bands[order]) == 0]
    if len(repeated):
        raise SpectrumError(
            f"band wavelength {repeated[0]:g} nm occurs twice", remedy="average or drop one of the two bands"
        )
    return order


def _hermite(knots: Float64Array, at: Float64Array) -> tuple[IntArray, Float64Array]:
    """Interval index (n,) and cubic Hermite basis (n, 4): values left, right; slopes left, right."""
    index = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    width = knots[index + 1] - knots[index]
    t = (at - knots[index]) / width
    basis = np.stack(
        [(1 + 2 * t) * (1 - t) ** 2, t**2 * (3 - 2 * t), width * t * (1 - t) ** 2, width * t**2 * (t - 1)], axis=1
    )
    return index, basis


def _spline_slope_operator(knots: Float64Array) -> Float64Array:
    """Operator (n, n) from values to the slopes of the not-a-knot cubic spline; nobody may write to it."""
    if len(knots) > _LARGEST_KEPT:
        return _new_slope_operator(knots)
    return _kept_slope_operator(knots.tobytes())


@lru_cache(maxsize=8)
def _kept_slope_operator(knots: bytes) -> Float64Array:
    """All lights of a texture ask for the same one."""
    return frozen(_new_slope_operator(np.frombuffer(knots)))


def _new_slope_operator(knots: Float64Array) -> Float64Array:
    """Operator (n, n) from values to the slopes of the not-a-knot cubic spline.

    Continuity of the second derivative inside; continuity of the third at the second and the last
    but one knot (de Boor 1978, chapter IV). Two or three knots give the line or the parabola.
    """
    n = len(knots)
    h = np.diff(knots)
    if n == 2:
        return np.tile(np.array([-1.0, 1.0]) / h[0], (2, 1))
    below, diagonal, above = np.zeros(n), np.empty(n), np.zeros(n)
    right = np.zeros((n, n))
    rows = np.arange(1, n - 1)
    below[rows], diagonal[rows], above[rows] = h[1:], 2 * (h[:-1] + h[1:]), h[:-1]
    right[rows, rows - 1] = -3 * h[1:] / h[:-1]
    right[rows, rows + 1] = 3 * h[:-1] / h[1:]
    right[rows, rows] = -right[rows, rows - 1] - right[rows, rows + 1]
    for row, (a, b, c), (p, q) in ((0, (0, 1, 2), (h[0], h[1])), (n - 1, (n - 1, n - 2, n - 3), (h[-1], h[-2]))):
        beside = above if row == 0 else below
        if n == 3:
            # One parabola: the end slope is twice the chord's less the middle slope.
            diagonal[row] = beside[row] = 1.0
            right[row, [a, b]] = np.array([-2.0, 2.0]) / (knots[b] - knots[a])
            continue
        sign = 1.0 if row == 0 else -1.0
        diagonal[row], beside[row] = q, p + q
        first = q * (3 * p + 2 * q) / (p * (p + q))
        second = p * p / (q * (p + q))
        right[row, a] = -sign * first
        right[row, b] = sign * (first - second)
        right[row, c] = sign * second
    return _solve_tridiagonal(below, diagonal, above, right)


def _solve_tridiagonal(
    below: Float64Array, diagonal: Float64Array, above: Float64Array, right: Float64Array
) -> Float64Array:
    """The solution (n, m) of a tridiagonal system for right sides (n, m), by elimination.

    Without pivots: the spline's inner rows are dominated by their diagonal, and its first and last keep a
    positive one. In n^2 steps where a dense solver takes n^3, and without waking BLAS's threads, which
    spin for a while after they are done and slow down whatever comes next.
    """
    solution = right.copy()
    pivots = diagonal.copy()
    for row in range(1, len(pivots)):
        factor = below[row] / pivots[row - 1]
        pivots[row] -= factor * above[row - 1]
        solution[row] -= factor * solution[row - 1]
    solution[-1] /= pivots[-1]
    for row in range(len(pivots) - 2, -1, -1):
        solution[row] -= above[row] * solution[row + 1]
        solution[row] /= pivots[row]
    return solution
