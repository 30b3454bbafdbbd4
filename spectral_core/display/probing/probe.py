"""What a runtime did to the codes, from readings of a short sequence of patches.

Every runtime of `runtimes` is a hypothesis: its parameters are fitted to the readings through the
panel's profile, and hypotheses are compared by the extended Bayesian information criterion (Chen
and Chen 2008): misfit + k ln(n) + 2 ln(number of hypotheses with as many stages). So a parameter,
and a stage chosen among many, must pay for themselves: the simplest that explains the readings wins.

Misfit is the squared distance in L*a*b* in units of what an instrument (1 % in luminance, 0.0015 in
x and y) and a profile (0.3) leave, 25 d² / (25 + d²) per patch: one bad reading costs any hypothesis
at most 25. Combinations are tried only when nothing simpler is within the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.builtin import srgb
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import DisplayModel
from spectral_core.display.probing.references import AssumedPanel, ProfiledPanel, Reference
from spectral_core.display.probing.runtimes import Runtime, combined_runtimes, single_runtimes
from spectral_core.errors import DisplayError
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

# What an instrument and a profile leave, as the text above says; dark readings no better than this share of white.
NOISE_Y, NOISE_XY, NOISE_PROFILE, _NOISE_DARK = 0.01, 0.0015, 0.3, 1e-4
# Square of the distance at which a reading counts half of what its square would.
_CAP = 25.0
# What 25 d² / (25 + d²) is on average for three normal deviates, instead of 3.
_EXPECTED = 2.49
# Twice the logarithm of a Bayes factor that Kass and Raftery (1995) call strong.
DECIDED = 6.0
# Misfit beyond this many times the noise, or more than this share of readings five deviations off: the
# truth is none of the hypotheses.
_EXPLAINED, _BAD_SHARE = 2.0, 0.1
# Hypotheses whose colours differ by less than this on average are one to the eye; by less than a profile
# may be off, the simplest is taken.
_SAME_DE00, _NEGLIGIBLE_DE00 = 1.0, 0.5
_FEWEST = 8
_STEPS = 30


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to readings.

    Attributes
    ----------
    runtime
        The hypothesis.
    parameters, deviations
        (k,) its parameters and their standard deviations.
    own
        The panel's own parameters.
    misfit
        (n,) per patch, in units of the noise.
    prior
        What the panel's own parameters cost.
    dE00
        (n,) between readings and prediction.
    score
        Extended BIC, smaller is better.
    """

    runtime: Runtime
    parameters: Float64Array
    deviations: Float64Array
    own: Float64Array
    reference: Reference
    misfit: Float64Array
    prior: float
    dE00: Float64Array
    score: float = np.inf

    @property
    def cost(self) -> float:
        """Misfit of all patches, and of what was assumed of the panel."""
        return float(self.misfit.sum()) + self.prior


@dataclass(frozen=True)
class Probe:
    """What readings tell of a runtime.

    Attributes
    ----------
    best
        The hypothesis of the smallest score, or a simpler one of practically the same effect.
    decided
        Whether the readings tell it from every other one of another effect.
    fits
        All hypotheses, smallest score first.
    rivals
        Those of another effect that the readings do not tell from the best.
    margin
        Score of the best rival or, when decided, of the next hypothesis of another effect, less that of the best.
    noise
        Misfit of the best in units of the expected noise, at least 1.
    warnings
        What a user should know.
    """

    best: Fit
    decided: bool
    fits: tuple[Fit, ...]
    rivals: tuple[Fit, ...]
    margin: float
    noise: float
    warnings: tuple[str, ...]

    @property
    def name(self) -> str:
        """The runtime's name, or ``undecided``."""
        return self.best.runtime.name if self.decided else "undecided"


def probe(measured: Measurements, panel: DisplayModel | None = None) -> Probe:
    """Infer the runtime from readings; `panel` is the profile's model, measured without the runtime.

    Without a panel an additive one is assumed, of gamma 1.8 to 2.6 or sRGB's curve: gamut remaps, and
    a gamma within that range, cannot be told then.

    Raises
    ------
    DisplayError
        If there are fewer than eight patches.
    """
    if len(measured.codes) < _FEWEST:
        raise DisplayError(
            f"{len(measured.codes)} patches cannot tell a runtime", remedy="measure those of `probe --patches`"
        )
    readings = _Readings.of(measured)
    references: list[Reference]
    references = [ProfiledPanel(panel)] if panel else [AssumedPanel(readings.XYZ, power) for power in (True, False)]
    fits = [_best_of(readings, runtime, references) for runtime in single_runtimes(panel)]
    prices = [2 * np.log(len(fits) - 1) if fit.runtime.stages else 0.0 for fit in fits]
    noise = _noise(fits, len(measured.codes))
    if noise > 1:
        # Combinations are tried only when nothing simpler is within the noise.
        pairs = [_best_of(readings, runtime, references) for runtime in combined_runtimes(panel)]
        prices += [2 * np.log(len(pairs))] * len(pairs)
        fits += pairs
        noise = _noise(fits, len(measured.codes))
    parameter = np.log(3 * len(measured.codes))
    fits = [
        replace(fit, score=fit.cost / noise**2 + parameter * len(fit.parameters) + price)
        for fit, price in zip(fits, prices, strict=True)
    ]
    return _verdict(sorted(fits, key=lambda fit: fit.score), noise, readings, panel is not None)


@dataclass(frozen=True)
class _Readings:
    """Codes (n, 3), XYZ (n, 3) with white at Y = 1, its Lab, and what whitens differences of Lab (n, 3, 3)."""

    codes: Float64Array
    XYZ: Float64Array
    Lab: Float64Array
    whitening: Float64Array

    @classmethod
    def of(cls, measured: Measurements) -> _Readings:
        XYZ = measured.XYZ / measured.white_XYZ[1]
        white = measured.white_XYZ / measured.white_XYZ[1]
        Lab = XYZ_to_Lab(XYZ, white)
        step = 1e-6
        slopes = np.stack([(XYZ_to_Lab(XYZ + step * axis, white) - Lab) / step for axis in np.eye(3)], axis=-1)
        covariance = slopes @ _instrument_covariance(XYZ) @ np.swapaxes(slopes, -1, -2) + NOISE_PROFILE**2 * np.eye(3)
        return cls(measured.codes, XYZ, Lab, np.linalg.inv(np.linalg.cholesky(covariance)))

    @property
    def white(self) -> Float64Array:
        """XYZ (3,) of measured white."""
        return np.asarray(self.XYZ[(self.codes > 0.999).all(axis=1)].mean(axis=0))


def _instrument_covariance(XYZ: Float64Array) -> Float64Array:
    """(n, 3, 3) of XYZ for errors of x, y and, relatively, Y."""
    total = np.maximum(XYZ.sum(axis=1), 1e-6)
    X, Y, _ = XYZ.T
    Y = np.maximum(Y, 1e-6)
    zero = np.zeros_like(total)
    by_x = np.stack([total**2 / Y, zero, -(total**2) / Y], axis=1) * (Y / total)[:, None]
    by_y = np.stack([-X * total / Y, zero, -(total - X) * total / Y], axis=1)
    directions = np.stack([NOISE_XY * by_x, NOISE_XY * by_y, NOISE_Y * XYZ], axis=-1)
    return np.asarray(directions @ np.swapaxes(directions, -1, -2) + _NOISE_DARK**2 * np.eye(3))


def _noise(fits: Sequence[Fit], patches: int) -> float:
    """The best misfit per degree of freedom as a multiple of the expected noise, at least 1."""
    freedom = [3 * patches - len(fit.parameters) - len(fit.own) for fit in fits]
    smallest = min(fit.cost / max(free, 1) for fit, free in zip(fits, freedom, strict=True))
    return max(1.0, float(np.sqrt(smallest * 3 / _EXPECTED)))


def _best_of(readings: _Readings, runtime: Runtime, references: Sequence[Reference]) -> Fit:
    return min((_fit(readings, runtime, each) for each in references), key=lambda fit: fit.cost)


def _fit(readings: _Readings, runtime: Runtime, reference: Reference) -> Fit:
    """Levenberg and Marquardt's descent from the best start, readings far off left to fade."""
    count = len(runtime.parameters)
    low, high = (np.concatenate(pair) for pair in zip(runtime.bounds(), reference.bounds, strict=True))

    def residuals(values: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(m, n, 3) whitened, and (m, q) of the prior."""
        own = values[:, count:]
        predicted = reference.predict(runtime.forward(readings.codes, values[:, :count]), own)
        difference = XYZ_to_Lab(predicted, readings.white) - readings.Lab
        return (readings.whitening @ difference[..., None])[..., 0], reference.prior(own)

    def costs(values: Float64Array) -> Float64Array:
        of_readings, of_prior = residuals(values)
        return np.asarray(_capped(of_readings).sum(axis=1) + (of_prior**2).sum(axis=1))

    starts = runtime.starts()
    starts = np.concatenate([starts, np.broadcast_to(reference.start, (len(starts), len(reference.start)))], axis=1)
    values = starts[int(costs(starts).argmin())]
    cost, damping = float(costs(values[None])[0]), 1e-2
    information = np.zeros((len(values), len(values)))
    for _ in range(_STEPS if len(values) else 0):
        step = 1e-5 * np.maximum(np.abs(values), 0.1)
        step = np.where(values + step > high, -step, step)
        of_readings, of_prior = residuals(np.concatenate([values[None], values + np.diag(step)]))
        slopes = (of_readings[1:] - of_readings[0]) / step[:, None, None]
        weight = (_CAP / (_CAP + (of_readings[0] ** 2).sum(axis=-1))) ** 2
        prior_slopes = (of_prior[1:] - of_prior[0]) / step[:, None]
        information = np.einsum("ane,bne,n->ab", slopes, slopes, weight) + prior_slopes @ prior_slopes.T
        gradient = np.einsum("ane,ne,n->a", slopes, of_readings[0], weight) + prior_slopes @ of_prior[0]
        tries = np.array([damping / 10, damping, damping * 10, damping * 100])
        scale = np.diag(np.diag(information) + 1e-9)
        moves = np.stack([np.linalg.solve(information + each * scale, -gradient) for each in tries])
        candidates = np.clip(values + moves, low, high)
        found = costs(candidates)
        index = int(found.argmin())
        if found[index] < cost - 1e-6:
            values, cost, damping = candidates[index], float(found[index]), max(float(tries[index]), 1e-9)
        elif damping > 1e6 or found[index] < cost + 1e-9:
            break
        else:
            damping *= 1e3
    return _fitted(readings, runtime, reference, values, residuals(values[None]), information)


def _fitted(
    readings: _Readings, runtime: Runtime, reference: Reference, values: Float64Array,
    residuals: tuple[Float64Array, Float64Array], information: Float64Array,
) -> Fit:  # fmt: skip
    count = len(runtime.parameters)
    predicted = reference.predict(runtime.forward(readings.codes, values[None, :count]), values[None, count:])[0]
    scale = np.sqrt(np.diag(information)) + 1e-12
    covariance = np.linalg.pinv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return Fit(
        runtime,
        frozen(values[:count]),
        frozen(np.sqrt(np.maximum(np.diag(covariance)[:count], 0))),
        frozen(values[count:]),
        reference,
        frozen(_capped(residuals[0])[0]),
        float((residuals[1] ** 2).sum()),
        frozen(delta_E_2000(XYZ_to_Lab(predicted, readings.white), readings.Lab)),
    )


def _capped(residuals: Float64Array) -> Float64Array:
    """Misfit (m, n) of whitened residuals (m, n, 3) (Geman and McClure 1987)."""
    squared = (residuals**2).sum(axis=-1)
    return np.asarray(_CAP * squared / (_CAP + squared))


def _verdict(fits: list[Fit], noise: float, readings: _Readings, profiled: bool) -> Probe:
    simple = [fit for fit in fits if len(fit.parameters) < len(fits[0].parameters)]
    same = [fit for fit in simple if _effect(fit, fits[0]) < _NEGLIGIBLE_DE00]
    best = min((fits[0], *same), key=lambda fit: len(fit.parameters))
    others = [fit for fit in fits if fit is not best]
    # What has the same effect is no rival, whatever its name: its correction is as good.
    others = [fit for fit in others if _effect(fit, best) > _SAME_DE00]
    rivals = tuple(fit for fit in others if _is_rival(fit, best, noise))
    far = np.flatnonzero(best.misfit > _CAP / 2)
    explained = noise <= _EXPLAINED and len(far) <= max(1, _BAD_SHARE * len(readings.codes))
    warnings = []
    if best is not fits[0]:
        warnings.append(
            f"{fits[0].runtime.name} fits better, but differs from {best.runtime.name} by less than a profile "
            f"may be off ({_effect(fits[0], best):.2f} dE00)"
        )
    if not explained:
        warnings.append(
            f"no hypothesis explains the readings: the nearest, {best.runtime.name}, leaves {best.dE00.mean():.1f} "
            f"dE00 on average, and {len(far)} readings out of the noise"
        )
    elif len(far):
        warnings.append(f"perhaps bad readings, left to fade: {', '.join(map(_code, readings.codes[far]))}")
    if explained and rivals:
        named = ", ".join(fit.runtime.name for fit in rivals[:4])
        warnings.append(f"the readings do not tell {best.runtime.name} from {named}; measure `probe --patches`")
    if not profiled:
        warnings.append(
            "no profile: an additive panel of gamma 1.8 to 2.6, or sRGB's curve, is assumed; a gamut remap, "
            "and a wrong gamma within that range, cannot be told from the panel's own"
        )
    margin = (rivals or others)[0].score - best.score
    return Probe(best, explained and not rivals, tuple(fits), rivals, margin, noise, tuple(warnings))


def _is_rival(fit: Fit, best: Fit, noise: float) -> bool:
    """Whether the readings leave a hypothesis standing.

    Occam may reject a parameter that does not pay, but never one of two equally simple hypotheses
    that explain the readings equally well; and no verdict may hang on a single reading.
    """
    misfit = (fit.misfit - best.misfit) / noise**2
    if len(fit.parameters) <= len(best.parameters) and fit.cost - best.cost < DECIDED * noise**2:
        return True
    return fit.score - best.score < DECIDED or fit.score - best.score - max(float(misfit.max()), 0.0) < 0


def _effect(a: Fit, b: Fit) -> float:
    """Mean dE00 between what two hypotheses make of colours all over the cube, on an sRGB screen."""
    levels = np.linspace(0.05, 0.95, 5)
    codes = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(-1, 3)
    white = srgb().to_XYZ(np.ones(3))
    shown = [XYZ_to_Lab(srgb().to_XYZ(fit.runtime.forward(codes, fit.parameters[None])[0]), white) for fit in (a, b)]
    return float(delta_E_2000(shown[0], shown[1]).mean())


def _code(code: Float64Array) -> str:
    return "/".join(f"{255 * channel:.0f}" for channel in code)
