"""A display to try patches on: a fitted model, dimming at high loads, an instrument's noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.display.builtin import load_profile
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.characterising.noise import noisy
from spectral_core.display.characterising.repeats import reading_noise
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import DisplayModel

# Of an instrument nobody knows: what the published headset's was, in ln Y and in x and y.
ASSUMED_NOISE = (0.01, 0.0015)
# (R + G + B - 2 black) / white - 1 of the published headset (Diaz-Barrancas et al. 2020, Table 1).
_ASSUMED_ADDITIVITY = 0.127
# Of white's luminance: darker patches say little of a noise in proportion.
_BRIGHT = 0.05


@dataclass(frozen=True)
class SimulatedDisplay:
    """What a display might be, white at Y = 1.

    Attributes
    ----------
    model
        Codes to XYZ without dimming.
    dimming
        All light is divided by ``1 + dimming * load**2``, the load the luminance over that of all
        channels: a headset with a power limit. 0 if the model itself holds what was measured.
    noise
        Standard deviations of one reading, of ln Y and of x and y.
    """

    model: DisplayModel
    dimming: float
    noise: tuple[float, float]

    def XYZ(self, codes: Float64Array) -> Float64Array:
        """XYZ (n, 3) of codes (n, 3), noise-free."""
        black = np.maximum(self.model.forward(np.zeros(3)), 0.0)
        light = np.maximum(self.model.forward(codes) - black, 0.0)
        full = (self.model.forward(np.eye(3)) - black)[:, 1].sum()
        return np.asarray(light / (1 + self.dimming * (light[:, 1:2] / full) ** 2) + black)

    def measure(self, codes: Float64Array, rng: np.random.Generator) -> Measurements:
        """Readings of codes (n, 3)."""
        return Measurements(frozen(codes), frozen(noisy(self.XYZ(codes), self.noise, rng)))


def assumed_display() -> SimulatedDisplay:
    """A headset nobody has measured: the published one, not additive, and its noise."""
    model = load_profile("htc-vive-2020").model
    return SimulatedDisplay(model, _dimming(model, _ASSUMED_ADDITIVITY), ASSUMED_NOISE)


def simulated(found: Characterisation) -> SimulatedDisplay:
    """A display like the characterised one.

    A set too small for a test has a model that is additive whatever the display: it dims as the
    measured sum of the channels says.
    """
    model = found.chosen.model
    dimming = _dimming(model, found.checks.additivity_error) if found.chosen.held_out is None else 0.0
    return SimulatedDisplay(model, dimming, _noise(found))


def _dimming(model: DisplayModel, additivity: float) -> float:
    """What makes R + G + B exceed white by `additivity`; 0 if they do not."""
    share = (model.forward(np.eye(3)) - model.forward(np.zeros(3)))[:, 1]
    share = share / share.sum()
    tried = np.linspace(0, 2, 2001)
    excess = (1 + tried) * (share / (1 + tried[:, None] * share**2)).sum(axis=1) - 1
    return float(np.interp(additivity, excess, tried))


def _noise(found: Characterisation) -> tuple[float, float]:
    """Noise from repeats; without enough of them from what the model leaves; else as assumed."""
    measured = found.measured
    repeated = reading_noise(measured)
    if repeated is not None:
        return repeated
    if found.chosen.held_out is None:
        return ASSUMED_NOISE
    bright = measured.XYZ[:, 1] > _BRIGHT
    XYZ, fitted = measured.XYZ[bright], found.chosen.model.forward(measured.codes[bright])
    xy_error = XYZ_to_xy(XYZ) - XYZ_to_xy(fitted)
    return _robust_deviation(np.log(XYZ[:, 1] / fitted[:, 1])), _robust_deviation(xy_error)


def _robust_deviation(values: Float64Array) -> float:
    """Standard deviation of a normal distribution with this median size: one bad patch does not count."""
    return float(1.4826 * np.median(np.abs(values)))
