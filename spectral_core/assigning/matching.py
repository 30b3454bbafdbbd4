"""The reflectance of a library that comes nearest to a colour, or a mixture of some that come near."""

from __future__ import annotations

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray
from spectral_core.assigning.choice import Choice
from spectral_core.assigning.library import Library
from spectral_core.assigning.mixing import mixtures
from spectral_core.assigning.nearest import nearest
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER

# More are no neighbours any more.
MOST_MIXED = 64


class Nearest:
    """Each colour gets the reflectance of the library whose colour is nearest by CIEDE2000, exactly."""

    method = "nearest"

    def __init__(self, library: Library, light: Light, observer: str = DEFAULT_OBSERVER) -> None:
        self.wavelengths_nm, self.table = library.wavelengths_nm, library.values
        self._white = light.XYZ(observer)
        self._Lab = library.Lab(light, observer)

    def choose(self, XYZ: Float64Array, own: IntArray | None = None) -> Choice:
        """As `SpectraOfColours.choose`."""
        found = nearest(standards.XYZ_to_Lab(XYZ, self._white), self._Lab, 1, own)
        return Choice(found.rows, None, found.dE00[:, 0], np.zeros(len(XYZ), dtype=bool))


class Mixed:
    """Each colour gets a mixture of the reflectances nearest to it that is a smooth function of the colour.

    Raises
    ------
    SpectrumError
        If the library has fewer than the wanted number.
    """

    def __init__(self, library: Library, light: Light, count: int, observer: str = DEFAULT_OBSERVER) -> None:
        if not 2 <= count <= MOST_MIXED:
            raise SpectrumError(f"mixtures of {count} spectra", remedy=f"mix 2 to {MOST_MIXED}; 8 to 16 do well")
        if count > len(library.names) - 1:
            raise SpectrumError(
                f"mixtures of {count} spectra from a library of {len(library.names)}",
                remedy="mix fewer, or give a larger library",
            )
        self.method = f"mixture of {count}"
        self.wavelengths_nm, self.table = library.wavelengths_nm, library.values
        self._white, self._count = light.XYZ(observer), count
        self._XYZ, self._Lab = library.XYZ(light, observer), library.Lab(light, observer)

    def choose(self, XYZ: Float64Array, own: IntArray | None = None) -> Choice:
        """As `SpectraOfColours.choose`."""
        # One more: where it comes in, the last of the mixture has faded out.
        wanted = min(self._count + 1, len(self._XYZ) - (own is not None))
        found = nearest(standards.XYZ_to_Lab(XYZ, self._white), self._Lab, wanted, own)
        rows = found.rows[:, : self._count]
        weights, dE00 = mixtures(XYZ, self._white, self._XYZ[rows], found.dE00)
        return Choice(rows, weights, dE00, np.zeros(len(XYZ), dtype=bool))
