"""Lights designed to a colour: two-peak metamers and LED mixtures.

A two-peak metamer has the chromaticity of its target and nothing else in common with it: the
hardest test of colour management under lamps (Diaz-Barrancas et al. 2020, section 2.2).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np

from spectral_core import standards, weights
from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.errors import LightError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER

# The spectrum locus is used where the chromaticity is known well enough to solve for: beyond 700 nm
# it does not move. The CIE 2015 observers begin at 390 nm.
_LOCUS_NM = (380.0, 700.0)
_BUILTIN_PEAK_NM = 456.0
_SIMULATOR_XY = (0.3107, 0.3344)
_SIMULATOR_RF = 88.2
# All that six LEDs can have: mixtures of three.
_MOST_VERTICES = 20
_WORTH_A_SWEEP = 1e-3
_GRID_NM = np.arange(380.0, 781.0)


def two_peak_metamer(
    target_xy: Float64Array, first_peak_nm: float, observer: str = DEFAULT_OBSERVER, name: str = ""
) -> Light:
    """A light of two spectral lines with the chromaticity of `target_xy` (2,).

    The second wavelength is where the line from the first peak through the target meets the
    spectrum locus again (bisection to 1e-12 nm); the powers follow from the lever rule.

    Raises
    ------
    LightError
        If the peak is outside 380 nm (or the observer's first wavelength) to 700 nm, or no second
        line gives the target (the line leaves the gamut through the purples).
    """
    shortest = max(_LOCUS_NM[0], float(standards.observer_table(observer)[0][0]))
    longest = _LOCUS_NM[1]
    if not shortest <= first_peak_nm <= longest:
        raise LightError(
            f"first peak {first_peak_nm:g} nm is outside {shortest:g} to {longest:g} nm", remedy="give one inside"
        )
    target = np.asarray(target_xy, dtype=np.float64)
    first = _line_XYZ(first_peak_nm, observer)
    direction = target - XYZ_to_xy(first)

    def side(wavelength: float) -> float:
        offset = XYZ_to_xy(_line_XYZ(wavelength, observer)) - target
        return float(direction[0] * offset[1] - direction[1] * offset[0])

    for low, high in itertools.pairwise(np.arange(shortest, longest + 1)):
        if side(low) * side(high) > 0 or low <= first_peak_nm <= high:
            continue
        wavelength = _bisect(side, low, high)
        second = _line_XYZ(wavelength, observer)
        if (XYZ_to_xy(second) - target) @ direction <= 0:
            continue
        powers = _mixing_powers(first, second, target)
        if (powers > 0).all():
            return Light.from_lines(
                name or f"two peaks {first_peak_nm:g} + {wavelength:.2f} nm",
                [first_peak_nm, wavelength],
                (powers / powers.max()).tolist(),
            )
    raise LightError(
        f"no second line mixes with {first_peak_nm:g} nm to xy ({target[0]:.4f}, {target[1]:.4f})",
        remedy="its complement is a purple; move the first peak (430 to 480 nm suits daylight)",
    )


def led_mixture(
    target_xy: Float64Array,
    rf: float,
    count: int = 6,
    observer: str = DEFAULT_OBSERVER,
    name: str = "",
) -> Light:
    """An LED mixture (1 nm table) of exact chromaticity `target_xy` and a given CIE 224 Rf.

    LEDs of Ohno's spectral model with fixed, evenly spread peaks. All mixtures of the right
    chromaticity form a convex set, so every point between a mixture of low Rf (three LEDs) and
    one of high Rf (near the best) has it too: bisection along that line meets the wanted Rf.

    Raises
    ------
    LightError
        If fewer than three LEDs are asked for, the chromaticity is outside their gamut, or the Rf
        is out of reach (the reachable range is named).
    """
    if not 3 <= count <= 12:
        raise LightError(f"{count} LEDs: a mixture needs 3 to 12", remedy="give --leds 6")
    target = np.asarray(target_xy, dtype=np.float64)
    leds = _led_spectra(count)
    vertices = _metameric_vertices(leds, target, observer)
    if not len(vertices):
        raise LightError(
            f"xy ({target[0]:.4f}, {target[1]:.4f}) is outside the gamut of the {count} LEDs",
            remedy="give a chromaticity nearer to white, or more LEDs",
        )
    scores = np.array([_rf(vertex, leds) for vertex in vertices])
    low, low_rf = vertices[int(scores.argmin())], float(scores.min())
    # Twelve LEDs have a hundred vertices: a spread of them reaches as high, in seconds.
    spread = np.unique(np.linspace(0, len(vertices) - 1, _MOST_VERTICES).round().astype(int))
    high, high_rf = _best_mixture(vertices[spread], leds)
    if not low_rf <= rf <= high_rf:
        raise LightError(
            f"Rf {rf:g} is out of reach of {count} LEDs at xy ({target[0]:.4f}, {target[1]:.4f})",
            remedy=f"ask for {np.ceil(low_rf):g} to {np.floor(high_rf):g}, or use more LEDs",
        )
    for _ in range(40):
        middle = (low + high) / 2
        if _rf(middle, leds) < rf:
            low = middle
        else:
            high = middle
    powers = high @ leds
    return Light.from_table(name or f"{count} LEDs, Rf {rf:g}", _GRID_NM, powers / powers.max(), kind="designed")


@cache
def builtin_design(name: str) -> Light:
    """The built-in designed lights: `two-peaks-d65` and `d65-simulator`."""
    if name == "two-peaks-d65":
        return two_peak_metamer(Light.builtin("D65").xy(), _BUILTIN_PEAK_NM, name=name)
    return led_mixture(np.array(_SIMULATOR_XY), _SIMULATOR_RF, 6, name=name)


def _line_XYZ(wavelength: float, observer: str) -> Float64Array:
    return np.asarray(weights.colour_matching(np.array([wavelength]), observer)[0])


def _bisect(function: Callable[[float], float], low: float, high: float) -> float:
    sign = function(low)
    for _ in range(60):
        middle = (low + high) / 2
        if function(middle) * sign > 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _mixing_powers(first: Float64Array, second: Float64Array, target_xy: Float64Array) -> Float64Array:
    """Powers (2,) of two stimuli whose sum has the target's chromaticity (least squares, exact on the line)."""
    target = np.array([*target_xy, 1 - target_xy.sum()])
    powers, *_ = np.linalg.lstsq(np.stack([first, second], axis=1), target, rcond=None)
    return np.asarray(powers)


def _led_spectra(count: int) -> Float64Array:
    """(count, 401) LED spectra, peaks spread evenly from 440 to 650 nm, unit peak.

    Ohno (2005): (g + 2 g^5) / 3 with g a Gaussian; half width 25 nm, between the 20 nm of blue
    and the 35 nm of green dies.
    """
    peaks = np.linspace(440.0, 650.0, count)
    gaussian = np.exp(-(((_GRID_NM - peaks[:, None]) / 25.0) ** 2))
    return np.asarray((gaussian + 2 * gaussian**5) / 3)


def _metameric_vertices(leds: Float64Array, target_xy: Float64Array, observer: str) -> Float64Array:
    """Mixtures (vertices, count) of three LEDs each that have the target's chromaticity, Y = 1."""
    XYZ = leds @ weights.colour_matching(_GRID_NM, observer)
    target = np.array([target_xy[0], target_xy[1], 1 - target_xy.sum()]) / target_xy[1]
    vertices = []
    for chosen in itertools.combinations(range(len(leds)), 3):
        columns = XYZ[list(chosen)].T
        if np.linalg.cond(columns) > 1e8:
            continue
        powers = np.linalg.solve(columns, target)
        if (powers >= 0).all():
            mixture = np.zeros(len(leds))
            mixture[list(chosen)] = powers
            vertices.append(mixture)
    return np.array(vertices)


def _best_mixture(vertices: Float64Array, leds: Float64Array) -> tuple[Float64Array, float]:
    """A mixture of high Rf: coordinate search over the weights of the vertices, deterministic."""
    weights_ = np.full(len(vertices), 1 / len(vertices))
    best = _rf(weights_ @ vertices, leds)
    step = 1.0
    while step > 0.05:
        before = best
        for index in range(len(vertices)):
            for factor in (1 + step, 1 / (1 + step)):
                trial = weights_.copy()
                trial[index] *= factor
                trial /= trial.sum()
                score = _rf(trial @ vertices, leds)
                if score > best:
                    weights_, best = trial, score
        # Less is creeping along a ridge, which smaller steps leave at once.
        step = step if best > before + _WORTH_A_SWEEP else step / 2
    return np.asarray(weights_ @ vertices), best


def _rf(mixture: Float64Array, leds: Float64Array) -> float:
    return standards.fidelity_index(_GRID_NM, mixture @ leds)
