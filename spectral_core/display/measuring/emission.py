"""Emission spectra of patches: their XYZ with any observer, beside what the instrument itself says."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core import standards, weights
from spectral_core.arrays import Float64Array
from spectral_core.errors import DisplayError
from spectral_core.standards import DEFAULT_OBSERVER

_WAVELENGTH = re.compile(r"(?:SPEC_)?(\d+(?:\.\d+)?)\s*(?:nm)?", re.IGNORECASE)
_FEWEST_BANDS = 3
# Beyond these, in nm, a display's light hardly shows; within them, what was not measured is missing.
_VISIBLE = (400.0, 700.0)
_RANGE = (200.0, 3000.0)


@dataclass(frozen=True)
class Emission:
    """Spectra (n, bands) of patches at ascending wavelengths (bands,)."""

    wavelengths_nm: Float64Array
    powers: Float64Array

    def XYZ(self, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """Tristimulus values (n, 3), in the spectra's own units, not normalised."""
        widths = weights.quadrature_widths(self.wavelengths_nm)
        return np.asarray((self.powers * widths) @ weights.colour_matching(self.wavelengths_nm, observer))

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence if the spectra leave out visible light."""
        first, last = self.wavelengths_nm[[0, -1]]
        if first <= _VISIBLE[0] and last >= _VISIBLE[1]:
            return ()
        return (f"the spectra run from {first:g} to {last:g} nm only: light beyond counts as none",)


@dataclass(frozen=True)
class Agreement:
    """Difference of the spectra's XYZ, scaled to the instrument's white luminance, from its XYZ.

    `max_percent` is the largest of X, Y and Z in percent of white's luminance.
    """

    mean_dE00: float
    max_dE00: float
    max_percent: float


def wavelength(name: str) -> float | None:
    """The wavelength in nm that a column is named after (``380``, ``380 nm``, ``SPEC_380``), else None."""
    match = _WAVELENGTH.fullmatch(name.strip())
    return float(match[1]) if match and _RANGE[0] <= float(match[1]) <= _RANGE[1] else None


def emission(names: Sequence[str], columns: Sequence[Float64Array], path: Path) -> Emission | None:
    """Spectra from columns (n,) named after wavelengths; None if there are too few.

    Raises
    ------
    DisplayError
        If a wavelength occurs twice.
    """
    found = [(nm, values) for name, values in zip(names, columns, strict=True) if (nm := wavelength(name)) is not None]
    if len(found) < _FEWEST_BANDS:
        return None
    bands = np.array([each for each, _ in found])
    order = np.argsort(bands)
    if not (np.diff(bands[order]) > 0).all():
        raise DisplayError("a wavelength occurs twice in the header", where=path, remedy="drop one of the columns")
    return Emission(bands[order], np.stack([found[index][1] for index in order], axis=1))


def agreement(XYZ: Float64Array, spectral: Float64Array, white: int) -> Agreement:
    """Compare the instrument's XYZ (n, 3) with the spectra's (n, 3), scaled to agree in Y of patch `white`."""
    scaled = spectral * (XYZ[white, 1] / spectral[white, 1])
    dE00 = standards.dE00(scaled, XYZ, XYZ[white])
    percent = 100 * float(np.abs(scaled - XYZ).max() / XYZ[white, 1])
    return Agreement(float(dE00.mean()), float(dE00.max()), percent)
