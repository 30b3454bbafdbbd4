"""What the display report's plots and tables draw from: ramps with their models, held-out errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_uv
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models.fitting import primaries
from spectral_core.standards import XYZ_to_Lab

# With fewer levels there is no curve to show, only its end.
_FEWEST_LEVELS = 3
_EVEN_CODES = 201
# Darker greys, over white's luminance, have the colour of black and of noise.
DARK_GREY = 0.01
# Arrows of the larger errors shall be about this long, in units of a*, b*.
_ARROW = 30.0
_MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200, 500)


@dataclass(frozen=True)
class Ramp:
    """Luminance along a ramp, over that at full drive, and what the models make of it.

    Attributes
    ----------
    codes, luminance
        (n,) of the measured patches that give light, in rising order.
    unlit
        How many others there are above code 0: they read no light.
    black
        Luminance at codes 0.
    even_codes, curves
        (m,) codes, and by model the luminances there.
    residual_percent
        By model, (n,) model less measured in percent of measured.
    """

    name: str
    codes: Float64Array
    luminance: Float64Array
    unlit: int
    black: float
    even_codes: Float64Array
    curves: dict[str, Float64Array]
    residual_percent: dict[str, Float64Array]

    @property
    def darkest(self) -> float:
        """The smallest luminance read that is not 0."""
        return min(float(self.luminance.min()), self.black or np.inf)

    @property
    def largest_residual(self) -> float:
        """Of any model, in percent, without sign."""
        return max(float(np.abs(each).max()) for each in self.residual_percent.values())


@dataclass(frozen=True)
class HeldOut:
    """Mixed colours with their prediction by fits without them; CIELAB relative to the display's white.

    Attributes
    ----------
    codes, measured, predicted
        (n, 3); `measured` and `predicted` are CIELAB.
    uv, triangle
        (n, 2) CIE 1976 chromaticities as measured, NaN where X, Y or Z is not above 0; (3, 2) those of the primaries.
    dE00
        (n,).
    """

    codes: Float64Array
    measured: Float64Array
    predicted: Float64Array
    measured_over_white: Float64Array
    predicted_over_white: Float64Array
    uv: Float64Array
    triangle: Float64Array
    dE00: Float64Array

    @property
    def unlit(self) -> int:
        """How many have no chromaticity."""
        return int(np.isnan(self.uv[:, 0]).sum())

    @property
    def change(self) -> Float64Array:
        """(n, 3) predicted less measured L*, a*, b*."""
        return np.asarray(self.predicted - self.measured)

    @property
    def mean_change(self) -> Float64Array:
        """(3,) mean of `change`: what the model is off by on the whole."""
        return np.asarray(self.change.mean(axis=0))

    @property
    def magnification(self) -> float:
        """How much longer arrows of a*, b* are drawn than they are."""
        large = float(np.percentile(np.hypot(*self.change[:, 1:].T), 95))
        return next((each for each in reversed(_MAGNIFICATIONS) if each * large <= _ARROW), _MAGNIFICATIONS[0])


def ramps(found: Characterisation) -> list[Ramp]:
    """The ramps of red, green, blue and grey that were measured at enough levels."""
    chosen = {name: found.measured.channel(index) for index, name in enumerate(("red", "green", "blue"))}
    directions = {"red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "grey": (1, 1, 1)}
    masks = {**chosen, "grey": found.measured.grey}
    return [
        _ramp(found, name, np.array(direction, dtype=np.float64), masks[name])
        for name, direction in directions.items()
        if len(np.unique(found.measured.codes[masks[name]].max(axis=1))) >= _FEWEST_LEVELS
    ]


def _ramp(found: Characterisation, name: str, direction: Float64Array, mask: np.ndarray) -> Ramp:  # type: ignore[type-arg]
    measured = found.measured.subset(mask)
    codes = measured.codes.max(axis=1)
    # What reads 0 has no place on a logarithmic axis, and no residual in percent.
    lit = (codes > 0) & (measured.XYZ[:, 1] > 0)
    order = np.flatnonzero(lit)[np.argsort(codes[lit], kind="stable")]
    full = found.measured.at(*direction)
    assert full is not None  # checked when the file was read
    even = np.linspace(0, 1, _EVEN_CODES)
    luminance = measured.XYZ[order, 1] / full[1]
    curves = {each.name: each.model.forward(even[:, None] * direction)[:, 1] / full[1] for each in found.models}
    modelled = {each.name: each.model.forward(measured.codes[order])[:, 1] / full[1] for each in found.models}
    return Ramp(
        name,
        codes[order],
        luminance,
        int((codes > 0).sum() - lit.sum()),
        float(found.measured.black_XYZ[1] / full[1]),
        even[1:],
        {key: values[1:] for key, values in curves.items()},
        {key: 100 * (values / luminance - 1) for key, values in modelled.items()},
    )


def visible_greys(measured: Measurements) -> Measurements:
    """The greys of at least `DARK_GREY`, in rising order."""
    bright = measured.grey & (measured.XYZ[:, 1] >= DARK_GREY * measured.white_XYZ[1]) & (measured.XYZ > 0).all(axis=1)
    order = np.argsort(measured.codes.mean(axis=1), kind="stable")
    return measured.subset(order[bright[order]])


def primaries_XYZ(measured: Measurements) -> Float64Array:
    """(3, 3), rows the XYZ of red, green and blue at full drive as measured, black included."""
    return primaries(measured, np.zeros(3)).T


def held_out(found: Characterisation) -> HeldOut | None:
    """Of the chosen model; None if there were too few mixed colours to test it."""
    result = found.chosen
    if result.held_out is None:
        return None
    measured, white = found.held_out, found.measured.white_XYZ
    lit = (measured.XYZ > 0).all(axis=1)
    return HeldOut(
        measured.codes,
        XYZ_to_Lab(measured.XYZ, white),
        XYZ_to_Lab(result.held_out_XYZ, white),
        measured.XYZ / white,
        result.held_out_XYZ / white,
        np.where(lit[:, None], XYZ_to_uv(np.where(lit[:, None], measured.XYZ, white)), np.nan),
        XYZ_to_uv(primaries_XYZ(found.measured)),
        result.held_out_errors,
    )


def worst(held: HeldOut, count: int) -> Sequence[int]:
    """Indices of the largest errors, the largest first."""
    return [int(index) for index in np.argsort(-held.dE00, kind="stable")[:count]]
