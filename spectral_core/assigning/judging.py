"""How wrong reflectances that were found from colour are under another lamp: each of a library left out in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.assigning.choice import SpectraOfColours
from spectral_core.assigning.codes import between
from spectral_core.assigning.library import Library
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER


@dataclass(frozen=True)
class Spread:
    """Mean, 95th percentile and largest of colour differences (dE00)."""

    mean: float
    p95: float
    max: float

    @classmethod
    def of(cls, dE00: Float64Array) -> Spread:
        """Of colour differences (n,)."""
        return cls(float(dE00.mean()), float(np.percentile(dE00, 95)), float(dE00.max()))


@dataclass(frozen=True)
class HeldOut:
    """Prediction errors under a light.

    Attributes
    ----------
    light
        Its name.
    dE00
        Of reflectances found from colour under the scanner's lamp.
    rgb_texture
        Of what an RGB texture does: its linear sRGB times the lamp's.
    colours
        How many reflectances were left out in turn.
    """

    light: str
    dE00: Spread
    rgb_texture: Spread
    colours: int


def held_out(
    source: SpectraOfColours,
    library: Library,
    scanner: Light,
    lights: Sequence[Light],
    observer: str = DEFAULT_OBSERVER,
) -> tuple[HeldOut, ...]:
    """Give each reflectance of a library's colour a spectrum from the others, and compare under lights.

    Colours are those under the scanner's lamp, without a scanner's own errors.

    Raises
    ------
    SpectrumError
        If the library has one reflectance only.
    """
    if not lights:
        return ()
    if len(library.names) < 2:
        raise SpectrumError("one reflectance alone cannot be left out", remedy="give a larger library, or no --judge")
    XYZ = library.XYZ(scanner, observer)
    found = source.choose(XYZ, np.arange(len(XYZ))).spectra(source.table)
    white, matrix = scanner.XYZ(observer), standards.srgb_to_XYZ_matrix()
    linear = np.linalg.solve(matrix, between(white, matrix @ np.ones(3)) @ XYZ.T).T
    results = []
    for light in lights:
        own_white = light.XYZ(observer)
        true = library.XYZ(light, observer)
        predicted = found @ light.weighting_factors(source.wavelengths_nm, observer).matrix
        as_rgb = (linear * np.linalg.solve(matrix, own_white)) @ matrix.T
        errors = [Spread.of(standards.dE00(true, each, own_white)) for each in (predicted, as_rgb)]
        results.append(HeldOut(light.name, errors[0], errors[1], len(XYZ)))
    return tuple(results)
