"""The smoothest change of a reflectance that gives it the colour that is asked for."""

from __future__ import annotations

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray
from spectral_core.assigning.choice import Choice, SpectraOfColours
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER

# Beyond 0..1 by rounding only.
EDGE = 1e-6
# How far a change itself counts beside its second differences: keeps it from drifting where the lamp is dark.
_SIZE = 1e-3
_ROUNDS = 60
_RANK = 1e-9
_COLOURS = 1 << 14


def smoothest_change(wavelengths_nm: Float64Array, factors: Float64Array) -> Float64Array:
    """What (3, bands) a reflectance changes by per unit of X, Y and Z.

    Of all changes with that colour the one with the least integral of its squared second derivative, and a
    little of its square. Under a lamp of one or two lines, which cannot show every colour, the nearest it can.

    Parameters
    ----------
    wavelengths_nm
        (bands,), ascending.
    factors
        Weighting factors (bands, 3).
    """
    softness = np.linalg.inv(_bend(wavelengths_nm))
    # Under two lines colours differ in two ways only: what they cannot show stays undone.
    return np.asarray(
        np.linalg.pinv(factors.T @ softness @ factors, rcond=_RANK, hermitian=True) @ factors.T @ softness
    )


def _bend(wavelengths_nm: Float64Array) -> Float64Array:
    """The quadratic form (bands, bands) of that integral; wavelengths in units of their mean step."""
    bands = len(wavelengths_nm)
    at = wavelengths_nm / np.diff(wavelengths_nm).mean() if bands > 1 else wavelengths_nm
    widths = np.gradient(at) if bands > 1 else np.ones(1)
    form = _SIZE * np.diag(widths)
    if bands > 2:
        slope = np.diff(np.eye(bands), axis=0) / np.diff(at)[:, None]
        apart = (at[2:] - at[:-2]) / 2
        second = np.diff(slope, axis=0) / apart[:, None]
        form += second.T @ (apart[:, None] * second)
    return np.asarray(form)


def with_colours(
    reflectances: Float64Array, XYZ: Float64Array, wavelengths_nm: Float64Array, factors: Float64Array
) -> Float64Array:
    """Reflectances (n, bands) changed smoothly so that their colours are XYZ (n, 3).

    Within 0..1 where some rounds of cutting and changing again get there; the colour is met in any case, but for
    what the lamp cannot show.
    """
    change = smoothest_change(wavelengths_nm, factors)
    result = reflectances + (XYZ - reflectances @ factors) @ change
    for _ in range(_ROUNDS):
        beyond = ((result < -EDGE) | (result > 1 + EDGE)).any(axis=1)
        if not beyond.any():
            break
        cut = np.clip(result[beyond], 0.0, 1.0)
        result[beyond] = cut + (XYZ[beyond] - cut @ factors) @ change
    return np.asarray(result)


class Exact:
    """Reflectances of a library, each changed smoothly towards the colour as far as 0..1 allows.

    Attributes
    ----------
    method, wavelengths_nm, table
        As of `SpectraOfColours`; the last three rows of the table are the change per X, Y and Z.
    """

    def __init__(self, source: SpectraOfColours, light: Light, observer: str = DEFAULT_OBSERVER) -> None:
        self.method = f"{source.method}, changed smoothly to the colour"
        self.wavelengths_nm = source.wavelengths_nm
        self._source, self._white = source, light.XYZ(observer)
        self._factors = light.weighting_factors(source.wavelengths_nm, observer).matrix
        self._change = smoothest_change(source.wavelengths_nm, self._factors)
        self._effect = self._change @ self._factors
        self.table = np.concatenate([source.table, self._change])

    def choose(self, XYZ: Float64Array, own: IntArray | None = None) -> Choice:
        """As `SpectraOfColours.choose`."""
        found = self._source.choose(XYZ, own)
        missing = np.empty_like(XYZ)
        for first in range(0, len(XYZ), _COLOURS):
            part = slice(first, first + _COLOURS)
            missing[part] = self._missing(XYZ[part], found.part(part).spectra(self._source.table))
        # Less of a difference in XYZ is less of one in dE00, but where hues turn over.
        dE00 = standards.dE00(XYZ, self._colours(found) + missing @ self._effect, self._white)
        worse = dE00 > found.dE00
        missing[worse] = 0.0
        weights = np.ones(found.rows.shape) if found.weights is None else found.weights
        own_rows = np.broadcast_to(len(self._source.table) + np.arange(3), missing.shape)
        return Choice(
            np.concatenate([found.rows, own_rows], axis=1),
            np.concatenate([weights, missing], axis=1),
            np.minimum(dE00, found.dE00),
            found.outside,
        )

    def _missing(self, XYZ: Float64Array, reflectance: Float64Array) -> Float64Array:
        """How much X, Y and Z (n, 3) are added: all that is missing, or as much as keeps the reflectance in 0..1."""
        missing = XYZ - reflectance @ self._factors
        change = missing @ self._change
        # A measured reflectance that is beyond already must not go further.
        room = np.where(change > 0, np.maximum(reflectance, 1.0), np.minimum(reflectance, 0.0)) - reflectance
        share = np.divide(room, change, out=np.ones_like(change), where=np.abs(change) > 1e-12)
        return np.asarray(missing * np.clip(share.min(axis=1), 0.0, 1.0)[:, None])

    def _colours(self, found: Choice) -> Float64Array:
        return found.spectra(self._source.table @ self._factors)
