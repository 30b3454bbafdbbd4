"""Choose a display's model by its error on colours it was not fitted to."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray, frozen
from spectral_core.display.characterising.checks import Checks, check
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import DisplayModel
from spectral_core.display.models.fitting import MODEL_KINDS, ModelKind, gamma_fit, ramp_drive
from spectral_core.errors import DisplayError
from spectral_core.verification import Percentiles, percentiles

FOLDS = 5
_SEED = 1
# Fewer mixed colours than this are no test of a model.
_FEWEST_MIXED = 10
# A patch further off than this many times the median, and than 2 dE00, is called bad.
_BAD_RATIO, _BAD_DE00 = 12.0, 2.0


@dataclass(frozen=True)
class ModelResult:
    """A model on trial: dE00 on held-out mixed colours (None if too few) and on what it was fitted to.

    `held_out_errors` (m,) and the predictions `held_out_XYZ` (m, 3) are in the order of
    `Characterisation.held_out`. `nanoseconds` is what a pixel costs from codes to XYZ and back.
    """

    name: str
    model: DisplayModel
    held_out: Percentiles | None
    held_out_errors: Float64Array
    held_out_XYZ: Float64Array
    fit: Percentiles
    nanoseconds: float


@dataclass(frozen=True)
class Characterisation:
    """The chosen model and how it was chosen; models and `measured` have white at Y = 1."""

    chosen: ModelResult
    models: tuple[ModelResult, ...]
    measured: Measurements
    checks: Checks
    gamma: dict[str, tuple[float, float]]
    warnings: tuple[str, ...]

    @property
    def held_out(self) -> Measurements:
        """The mixed colours that the models were judged by, each predicted by fits without it."""
        return self.measured.subset(np.concatenate(folds(self.measured)))


def characterise(measured: Measurements, wanted: str | None = None) -> Characterisation:
    """Fit every model that the data supports, and choose the simplest within noise of the best.

    Within noise: its mean held-out dE00 exceeds the best one's by no more than the standard error
    of their paired differences. A single bad patch is found by the corrected model's own residual,
    left out and named.

    Raises
    ------
    DisplayError
        If `wanted` names no model, or one that the data does not support.
    """
    checks = check(measured)
    warnings = list(checks.warnings)
    # Models work with white at Y = 1.
    measured = replace(measured, XYZ=frozen(measured.XYZ / measured.white_XYZ[1]))
    kinds = [kind for kind in MODEL_KINDS if kind.supported_by(measured)]
    if wanted is not None and wanted not in [kind.name for kind in kinds]:
        raise DisplayError(
            f"the measurements do not support a model '{wanted}'",
            remedy=f"they support {', '.join(k.name for k in kinds)}",
        )
    measured, bad = _without_bad_patches(measured, kinds[-1])
    warnings += bad
    if measured.mixed.sum() < _FEWEST_MIXED:
        warnings.append(
            f"{int(measured.mixed.sum())} mixed colours are too few to test a model; {FOLDS * 10} are enough"
        )
    results = tuple(_on_trial(measured, kind) for kind in kinds)
    chosen = next((each for each in results if each.name == wanted), None) or simplest_within_noise(results)
    gamma = {
        name: gamma_fit(*ramp_drive(measured, index, measured.black_XYZ)) for index, name in enumerate(("R", "G", "B"))
    }
    if any(r2 == 0.0 for _, r2 in gamma.values()):
        warnings.append("the ramps are too short for a gamma: 2.2 is assumed where no grey ramp tells")
    return Characterisation(chosen, results, measured, checks, gamma, tuple(dict.fromkeys(warnings)))


def fitted(kind: ModelKind, measured: Measurements) -> DisplayModel:
    """The model of a kind.

    Raises
    ------
    DisplayError
        If its parameters are none that a display can have.
    """
    try:
        return kind.fit(measured)
    except DisplayError as error:
        raise DisplayError(
            f"a model '{kind.name}' cannot be fitted: {error.problem}",
            remedy="are the codes and the readings those of one display?",
        ) from None


def folds(measured: Measurements) -> list[IntArray]:
    """Indices of the held-out mixed colours of each fold; ramps and greys are always fitted."""
    mixed = np.random.default_rng(_SEED).permutation(np.flatnonzero(measured.mixed))
    return [np.sort(mixed[start::FOLDS]) for start in range(FOLDS)]


def errors(model: DisplayModel, measured: Measurements, white_XYZ: Float64Array) -> Float64Array:
    """dE00 (n,) of a model's XYZ from the measured."""
    predicted = model.forward(measured.codes)
    return standards.dE00(predicted, measured.XYZ, white_XYZ)


def held_out_XYZ(measured: Measurements, kind: ModelKind) -> Float64Array:
    """XYZ (mixed colours, 3) predicted by fits without them, in the order of `folds`; empty if there are too few."""
    if measured.mixed.sum() < _FEWEST_MIXED:
        return np.zeros((0, 3))
    found = []
    for test in folds(measured):
        kept = np.ones(len(measured.codes), dtype=bool)
        kept[test] = False
        found.append(fitted(kind, measured.subset(kept)).forward(measured.codes[test]))
    return np.concatenate(found)


def held_out_errors(measured: Measurements, predicted: Float64Array) -> Float64Array:
    """dE00 (mixed colours,) of what `held_out_XYZ` predicted."""
    if not len(predicted):
        return np.zeros(0)
    truth = measured.XYZ[np.concatenate(folds(measured))]
    white = measured.white_XYZ
    return standards.dE00(predicted, truth, white)


def _on_trial(measured: Measurements, kind: ModelKind) -> ModelResult:
    model = fitted(kind, measured)
    predicted = held_out_XYZ(measured, kind)
    outside = held_out_errors(measured, predicted)
    inside = errors(model, measured, measured.white_XYZ)
    return ModelResult(
        kind.name,
        model,
        percentiles(outside) if len(outside) else None,
        outside,
        predicted,
        percentiles(inside),
        _cost(model),
    )


def simplest_within_noise(results: tuple[ModelResult, ...]) -> ModelResult:
    """The rule by which a model is chosen, see `characterise`; results go from the simplest on."""
    if results[0].held_out is None:
        # Nothing to choose by: the most that the data supports without a test is the plain model with black.
        return results[min(1, len(results) - 1)]
    best = min(results, key=lambda each: each.held_out_errors.mean())
    for each in results:
        difference = each.held_out_errors - best.held_out_errors
        if difference.mean() <= difference.std() / np.sqrt(len(difference)):
            return each
    return best


def _without_bad_patches(measured: Measurements, kind: ModelKind) -> tuple[Measurements, list[str]]:
    if measured.mixed.sum() < _FEWEST_MIXED:
        return measured, []
    outside = held_out_errors(measured, held_out_XYZ(measured, kind))
    index = np.concatenate(folds(measured))
    bad = index[(outside > _BAD_RATIO * np.median(outside)) & (outside > _BAD_DE00)]
    if not len(bad) or len(bad) > 0.05 * len(measured.codes):
        return measured, []
    kept = np.ones(len(measured.codes), dtype=bool)
    kept[bad] = False
    named = ["/".join(f"{code:.2f}" for code in measured.codes[each]) for each in bad]
    return measured.subset(kept), [f"left out as bad readings: {', '.join(named)}"]


def _cost(model: DisplayModel) -> float:
    """Nanoseconds per pixel from codes to XYZ and back."""
    codes = np.random.default_rng(0).uniform(0.05, 0.95, (4096, 3))
    model.inverse(model.forward(codes))  # tables are made at the first use
    started = time.perf_counter()
    model.inverse(model.forward(codes))
    return (time.perf_counter() - started) / len(codes) * 1e9
