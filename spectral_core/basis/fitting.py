"""Bases with the smallest largest dE00 on samples.

Reduced-rank regression (a weighted singular value decomposition) minimises a mean square in XYZ. What is seen is dE00,
and what a tolerance is about is the largest of it. So the two matrices are fitted in turn, each an exact problem of
least squares in the local metric of dE00 round each sample, while samples gain weight with their error: a p-norm
whose p grows towards the maximum, by iteratively reweighted least squares (Lawson 1961; Burrus 1994). Alternation
finds a local optimum of a problem that is not convex, so the best matrices by the true largest dE00 are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, IntArray
from spectral_core.baking.products import one_blas_thread
from spectral_core.basis.metric import differences, local_metric
from spectral_core.basis.spectral_basis import SpectralBasis, check_lights, checked_samples, errors_of
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER

# The p-norm's p, first to last; beyond it single samples carry all the weight and the rest drifts away.
NORMS = np.geomspace(3.0, 30.0, 60)
# Weights follow their goal by this share of the step that converges for a linear problem, 1 / (p - 1).
_STEP = 1.7
# Iterations without a better maximum: later ones seldom find one, and get worse.
_PATIENCE = 15
_LEAST_WEIGHT = 1e-12
# Where the number of coefficients is searched: the first that is tried, and what no fit makes good any more after so
# many iterations (1.6 times is the most that was seen).
_FIRST_K = 6
_JUDGED_AFTER, _HOPELESS = 8, 3.0
# What no sample has shown is fitted as if all directions were there with this dE00: costs samples nothing that can
# be measured, halves the largest error of others, and keeps the matrices small.
_UNSEEN_dE00 = 0.05
_RIDGE = 1e-13
# Samples that are fitted at once; more are let in by their error.
_MOST_AT_ONCE = 600
_LET_IN = 150


@one_blas_thread()
def fit_basis(samples: FloatArray, lights: Sequence[Light], K: int, observer: str = DEFAULT_OBSERVER) -> SpectralBasis:
    """The basis of K coefficients with the smallest largest dE00 on samples that was found.

    The perfect diffuser is one of the samples, always: whites and greys stay what they are. K = 3 L is exact for
    everything.

    Parameters
    ----------
    samples
        (n, L, 3), XYZ of surfaces under each of the lights, perfect diffuser Y = 1.
    lights
        (L,).
    K
        1 to 3 L.
    observer
        That the samples are of.

    Raises
    ------
    SpectrumError, LightError
        If there is no sample, one is no number, or K is out of range.
    """
    check_lights(lights, observer)
    all_samples = _with_white(checked_samples(samples, lights), lights, observer)
    if isinstance(K, bool) or not isinstance(K, (int, np.integer)) or not 1 <= K <= 3 * len(lights):
        raise SpectrumError(
            f"no spectral basis of {K} coefficients for {len(lights)} lights",
            remedy=f"K is a whole number from 1 to {3 * len(lights)}, which is exact",
        )
    chosen = _first_chosen(len(all_samples))
    while True:
        found = _fit(_problem(all_samples[chosen], lights, observer), int(K))
        dE00 = found.differences(all_samples)
        worst = _worst(dE00, chosen)
        if not len(worst):
            return _finished(found, all_samples, lights, observer)
        chosen = np.union1d(chosen, worst)


@one_blas_thread()
def choose_basis(
    samples: FloatArray,
    lights: Sequence[Light],
    tolerance_dE00: float,
    observer: str = DEFAULT_OBSERVER,
    smallest: int = 3,
) -> SpectralBasis:
    """The basis with the fewest coefficients, from `smallest` on, whose largest dE00 on samples is within a tolerance.

    Raises
    ------
    SpectrumError, LightError
        As `fit_basis`, or if the tolerance is not positive.
    """
    check_lights(lights, observer)
    all_samples = _with_white(checked_samples(samples, lights), lights, observer)
    if not (np.isfinite(tolerance_dE00) and tolerance_dE00 > 0):
        raise SpectrumError(f"no basis is within dE00 {tolerance_dE00:g}", remedy="give a tolerance above 0")
    K = min(max(1, smallest), 3 * len(lights))
    chosen = _first_chosen(len(all_samples))
    while True:
        found = _smallest(_problem(all_samples[chosen], lights, observer), tolerance_dE00, K)
        dE00 = found.differences(all_samples)
        if dE00.max() <= tolerance_dE00 or 3 * len(lights) == found.K:
            return _finished(found, all_samples, lights, observer)
        worst = _worst(dE00, chosen)
        # All are in, or none is worse than those: there is nothing to learn but that K is too small.
        K = found.K if len(worst) else found.K + 1
        chosen = np.union1d(chosen, worst)


@dataclass(frozen=True)
class _Found:
    """Matrices analysis (D, K) and synthesis (L, 3, K), and the largest dE00 on the samples they were fitted to."""

    analysis: Float64Array
    synthesis: Float64Array
    largest: float
    whites: Float64Array

    @property
    def K(self) -> int:
        return self.analysis.shape[1]

    def differences(self, samples: Float64Array) -> Float64Array:
        shown = samples.reshape(len(samples), -1) @ self.analysis @ self.synthesis.reshape(-1, self.K).T
        return differences(shown.reshape(samples.shape), samples, self.whites)


@dataclass(frozen=True)
class _Problem:
    """Samples, and small ones in all directions after them, in coordinates in which they are uncorrelated.

    Attributes
    ----------
    count
        Of the real samples, which come first.
    targets
        (n, L, 3).
    metric
        (n, L, 3, 3).
    whitening
        (D, D): coordinates are the targets, flattened, times it; the most important first.
    coordinates
        (n, D).
    pairs
        (n, D * D), products of coordinates.
    whites
        (L, 3).
    """

    count: int
    targets: Float64Array
    metric: Float64Array
    whitening: Float64Array
    coordinates: Float64Array
    pairs: Float64Array
    whites: Float64Array


def _problem(samples: Float64Array, lights: Sequence[Light], observer: str) -> _Problem:
    whites = np.stack([light.XYZ(observer) for light in lights])
    count, dimensions = len(samples), 3 * len(lights)
    metric = local_metric(samples, whites)
    mean = metric.mean(axis=0)
    root = np.zeros((dimensions, dimensions))
    for index, block in enumerate(mean):
        part = slice(3 * index, 3 * index + 3)
        # A floor for lights under which all samples are alike in some way: a root must exist.
        root[part, part] = np.linalg.cholesky(block + 1e-9 * np.trace(block) * np.eye(3))
    unseen = _UNSEEN_dE00 * np.linalg.inv(root)
    flat = np.concatenate([samples.reshape(count, -1), unseen])
    # Lightness grows with the cube root: this makes dark samples count as much in the first guess as their dE00.
    size = np.linalg.norm(flat[:count] @ root, axis=1)
    size = np.maximum(size, 1e-3 * size.max()) ** (-2 / 3)
    weights = np.concatenate([size, np.full(dimensions, size.mean())])
    _, values, directions = np.linalg.svd((flat * weights[:, None]) @ root, full_matrices=False)
    whitening = root @ directions.T / values
    coordinates = flat @ whitening
    return _Problem(
        count=count,
        targets=flat.reshape(-1, len(lights), 3),
        metric=np.concatenate([metric, np.broadcast_to(mean, (dimensions, *mean.shape))]),
        whitening=whitening,
        coordinates=coordinates,
        pairs=_products(coordinates),
        whites=whites,
    )


def _smallest(problem: _Problem, tolerance: float, smallest: int) -> _Found:
    """The basis with the fewest coefficients: found in growing steps, then by halving the last one."""
    too_few, enough = smallest - 1, problem.whitening.shape[0]
    K = max(smallest, _FIRST_K)
    while too_few < enough - 1:
        K = min(max(K, too_few + 1), enough - 1)
        if _fit(problem, K, tolerance).largest <= tolerance:
            enough, K = K, (too_few + K) // 2
        else:
            too_few = K
            K = K + max(1, K // 2) if enough == problem.whitening.shape[0] else (K + enough) // 2
    return _fit(problem, enough)


def _fit(problem: _Problem, K: int, enough: float = 0.0) -> _Found:
    """Matrices of K coefficients; no more is done where the largest dE00 is `enough`, or will not be."""
    dimensions, count = problem.whitening.shape[0], problem.count
    if dimensions == K:
        identity = np.eye(dimensions)
        return _Found(identity, identity.reshape(-1, 3, dimensions), 0.0, problem.whites)
    analysis = np.eye(dimensions, K)
    weights = np.ones(problem.targets.shape[:2])
    best: _Found | None = None
    since = 0
    for iteration, norm in enumerate(NORMS):
        weighted = problem.metric * weights[:, :, None, None]
        synthesis = synthesis_step(problem.coordinates @ analysis, problem.targets, weighted)
        analysis = _analysis_step(problem, synthesis, weighted)
        shown = (problem.coordinates[:count] @ analysis) @ synthesis.reshape(-1, K).T
        targets = problem.targets[:count]
        dE00 = differences(shown.reshape(targets.shape), targets, problem.whites)
        largest = float(dE00.max())
        since += 1
        if best is None or largest < best.largest:
            best, since = _Found(problem.whitening @ analysis, synthesis, largest, problem.whites), 0
        hopeless = iteration == _JUDGED_AFTER and best.largest > _HOPELESS * enough > 0
        if best.largest <= enough or since > _PATIENCE or hopeless:
            break
        analysis = np.linalg.qr(analysis)[0]  # only what it spans matters to the synthesis that comes next
        weights[:count] = reweighted(weights[:count], dE00, float(norm))
    assert best is not None
    return best


def reweighted(weights: Float64Array, dE00: Float64Array, norm: float) -> Float64Array:
    """Weights of the next step of a p-norm, of any shape, with mean 1."""
    largest = dE00.max()
    if not largest > 0:
        return weights
    step = min(1.0, _STEP / (norm - 1))
    result = weights ** (1 - step) * np.maximum(dE00 / largest, 1e-3) ** (step * (norm - 2))
    return np.asarray(np.maximum(result / result.mean(), _LEAST_WEIGHT))


def synthesis_step(coefficients: Float64Array, targets: Float64Array, metric: Float64Array) -> Float64Array:
    """Synthesis (L, 3, K) that brings coefficients (n, K) nearest to targets (n, L, 3) in a metric (n, L, 3, 3)."""
    K = coefficients.shape[1]
    pairs = _products(coefficients)
    result = np.empty((targets.shape[1], 3, K))
    for index in range(len(result)):
        form = metric[:, index]
        matrix = (form.reshape(-1, 9).T @ pairs).reshape(3, 3, K, K).transpose(0, 2, 1, 3).reshape(3 * K, 3 * K)
        wanted = np.einsum("nij,nj->ni", form, targets[:, index]).T @ coefficients
        result[index] = _solve(matrix, wanted.reshape(-1)).reshape(3, K)
    return result


def _analysis_step(problem: _Problem, synthesis: Float64Array, metric: Float64Array) -> Float64Array:
    """Analysis (D, K) of the problem's coordinates for a synthesis (L, 3, K)."""
    dimensions, K = problem.whitening.shape[0], synthesis.shape[2]
    seen = metric @ synthesis  # (n, L, 3, K)
    count = len(seen)
    # Sums over lights and channels: (n, K, K) as one product.
    forms = np.matmul(synthesis.reshape(-1, K).T, seen.reshape(count, -1, K)).reshape(count, -1)
    matrix = (problem.pairs.T @ forms).reshape(dimensions, dimensions, K, K).transpose(0, 2, 1, 3)
    wanted = problem.coordinates.T @ np.einsum("nli,nlik->nk", problem.targets, seen)
    size = dimensions * K
    return _solve(matrix.reshape(size, size), wanted.reshape(-1)).reshape(dimensions, K)


def _products(values: Float64Array) -> Float64Array:
    """(n, D * D): all products of two columns of (n, D)."""
    return np.asarray((values[:, :, None] * values[:, None, :]).reshape(len(values), -1))


def _solve(matrix: Float64Array, wanted: Float64Array) -> Float64Array:
    """Solution of normal equations, with a ridge below what they can tell from nothing."""
    diagonal = np.arange(len(matrix))
    matrix[diagonal, diagonal] += max(_RIDGE * np.trace(matrix) / len(matrix), np.finfo(np.float64).tiny)
    return np.asarray(np.linalg.solve(matrix, wanted))


def _with_white(samples: Float64Array, lights: Sequence[Light], observer: str) -> Float64Array:
    return np.concatenate([samples, [[light.XYZ(observer) for light in lights]]])


def _first_chosen(count: int) -> IntArray:
    """Indices of the samples to begin with: all, or some all over them, and the white, which is the last."""
    if count <= _MOST_AT_ONCE:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, _MOST_AT_ONCE).round().astype(np.int64))


def _worst(dE00: Float64Array, chosen: IntArray) -> IntArray:
    """Indices of samples outside `chosen` with the largest dE00 (n, L), where it is above that of all inside."""
    of_each = dE00.max(axis=1)
    limit = of_each[chosen].max()
    of_each[chosen] = 0
    found = np.flatnonzero(of_each > limit)
    return np.asarray(found[np.argsort(-of_each[found], kind="stable")][:_LET_IN])


def _finished(found: _Found, samples: Float64Array, lights: Sequence[Light], observer: str) -> SpectralBasis:
    analysis, synthesis = _well_scaled(found, samples)
    scaled = _Found(analysis, synthesis, found.largest, found.whites)
    errors = errors_of(scaled.differences(samples), [light.name for light in lights])
    return SpectralBasis(tuple(lights), observer, analysis, synthesis, errors)


def _well_scaled(found: _Found, samples: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The same basis in coefficients that are uncorrelated over the samples, the largest of each 1 in size.

    Half floats round each coefficient relative to its size: principal components, in dE00 near white, keep what is
    rounded no larger than what it stands for.
    """
    flat = samples.reshape(len(samples), -1)
    K = found.K
    analysis, synthesis = found.analysis, found.synthesis.reshape(-1, K)
    if len(analysis) > K:  # else each is a tristimulus value, whatever the surface
        metric = local_metric(found.whites[None], found.whites)[0]
        roots = np.linalg.cholesky(metric + 1e-12 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(3))
        weighted = np.einsum("lij,lik->ljk", roots, found.synthesis).reshape(-1, K)
        # QR first: the coefficients as they are may be anything but well conditioned.
        r = np.linalg.qr(weighted)[1]
        spread = np.linalg.qr(flat @ analysis @ r.T)[1]
        _, _, directions = np.linalg.svd(spread, full_matrices=True)
        turned = r.T @ directions.T
        analysis, synthesis = analysis @ turned, np.linalg.solve(turned, synthesis.T).T
    coefficients = flat @ analysis
    at = np.argmax(np.abs(coefficients), axis=0)
    scale = coefficients[at, np.arange(K)]
    # A coefficient that no sample has: its size must not be made one.
    size = np.abs(scale)
    scale = np.where(size > 1e-9 * size.max(), scale, 1.0)
    return analysis / scale, (synthesis * scale).reshape(found.synthesis.shape)
