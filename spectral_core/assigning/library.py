"""A library of reflectances: spectra of one or several files on one grid of wavelengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.spectra import Spectra, colorchecker_spectra, read_spectra
from spectral_core.standards import DEFAULT_OBSERVER, XYZ_to_Lab
from spectral_core.weights import LARGEST_BANDS, interpolation_operator

# Share of the white beyond a library's ends that nobody sees.
_SEEN = 1e-4


@dataclass(frozen=True)
class Library:
    """Reflectances that texels can get.

    Attributes
    ----------
    names
        One per reflectance.
    wavelengths_nm
        (bands,), ascending.
    values
        (reflectances, bands), no two of them the same.
    warnings
        What a user should know of them.
    """

    names: tuple[str, ...]
    wavelengths_nm: Float64Array
    values: Float64Array
    warnings: tuple[str, ...] = ()

    def XYZ(self, light: Light, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """XYZ (reflectances, 3) under a light, perfect diffuser Y = 1."""
        return np.asarray(self.values @ light.weighting_factors(self.wavelengths_nm, observer).matrix)

    def Lab(self, light: Light, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """L*a*b* (reflectances, 3) relative to the light."""
        return XYZ_to_Lab(self.XYZ(light, observer), light.XYZ(observer))

    def unmeasured(self, light: Light, observer: str = DEFAULT_OBSERVER) -> list[str]:
        """One warning if a light has power where the library has no reflectance."""
        factors = light.weighting_factors(self.wavelengths_nm, observer)
        if factors.extended < _SEEN:
            return []
        return [
            f"reflectances from {self.wavelengths_nm[0]:g} to {self.wavelengths_nm[-1]:g} nm: {factors.extended:.2%} "
            f"of the X, Y or Z of {light.name} lies beyond and rests on their end values"
        ]


def read_library(sources: Sequence[str | Path], step_nm: float | None = None) -> Library:
    """A library from files that `read_spectra` reads, or from ``colorchecker``, the 24 built-in patches.

    Files on different grids are brought to that of the first by cubic splines, their ends repeated,
    and a step to even wavelengths of that step; both are said in the warnings. A reflectance that
    occurs twice counts once.

    Raises
    ------
    SpectrumError
        If there is none, a file cannot be used, or the step is impossible.
    """
    if not sources:
        raise SpectrumError("no library of reflectances", remedy="give --library FILE or --library colorchecker")
    parts = [(str(source), _read(source)) for source in sources]
    grid = parts[0][1].wavelengths_nm
    if step_nm is not None:
        grid = _even(grid, step_nm)
    warnings, values, names = [], [], []
    for source, spectra in parts:
        warnings += [f"{Path(source).name}: {warning}" for warning in spectra.warnings]
        if not np.array_equal(spectra.wavelengths_nm, grid):
            warnings.append(_regridded(Path(source).name, spectra.wavelengths_nm, grid))
        values.append(spectra.values @ interpolation_operator(spectra.wavelengths_nm, grid).T)
        prefix = f"{Path(source).stem} " if len(parts) > 1 else ""
        names += [f"{prefix}{name}" for name in spectra.names]
    table = np.concatenate(values)
    _, first = np.unique(table, axis=0, return_index=True)
    if len(first) < len(table):
        warnings.append(f"{len(table) - len(first)} reflectances are there twice and count once")
    kept = np.sort(first)
    return Library(tuple(names[i] for i in kept), frozen(grid), frozen(table[kept]), tuple(warnings))


def _read(source: str | Path) -> Spectra:
    spectra = colorchecker_spectra() if str(source) == "colorchecker" else read_spectra(source, "reflectance")
    if spectra.lines:
        raise SpectrumError("holds spectral lines, no reflectances", where=source, remedy="give curves")
    if len(spectra.wavelengths_nm) > LARGEST_BANDS:
        raise SpectrumError(
            f"{len(spectra.wavelengths_nm)} wavelengths, more than {LARGEST_BANDS}",
            where=source,
            remedy="average neighbouring ones: 1 nm is plenty",
        )
    return spectra


def _even(grid: Float64Array, step_nm: float) -> Float64Array:
    if not 0.1 <= step_nm <= 100 or grid[-1] - grid[0] < step_nm:
        raise SpectrumError(f"a step of {step_nm:g} nm is impossible", remedy="give one from 0.1 to 100 nm")
    even = np.asarray(np.arange(np.ceil(grid[0] / step_nm), np.floor(grid[-1] / step_nm) + 1) * step_nm)
    if not 2 <= len(even) <= LARGEST_BANDS:
        raise SpectrumError(f"{len(even)} wavelengths in steps of {step_nm:g} nm", remedy="choose another step")
    return even


def _regridded(name: str, own: Float64Array, grid: Float64Array) -> str:
    beyond = grid[0] < own[0] or grid[-1] > own[-1]
    ends = f"; it has none beyond {own[0]:g} to {own[-1]:g} nm, where its end values are repeated" if beyond else ""
    return f"{name}: resampled to {len(grid)} wavelengths from {grid[0]:g} to {grid[-1]:g} nm{ends}"
