"""Tables of spectra in MATLAB files: variables ``data`` and ``wavelength``, as ISETCam's reflectances have."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import SpectrumError, TextureError
from spectral_core.textures.matlab.file import Variable
from spectral_core.textures.matlab.texture import open_mat_file

# 64 MB of float64: far more than any library.
_MOST_NUMBERS = 8 << 20
_REMEDY = "give variables 'data', one column a spectrum, and 'wavelength' in nm"


def matlab_table(path: Path) -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) and values (spectra, n) as they stand in the file.

    Raises
    ------
    SpectrumError
        If it is damaged, or does not hold these variables.
    MissingExtraError
        If it is of version 7.3 and h5py is not installed.
    """
    try:
        file = open_mat_file(path)
        found = {each.name: each for each in file.variables}
        wavelength, data = (_numbers(found, name, path) for name in ("wavelength", "data"))
        wavelengths = file.vector(wavelength)
        # MATLAB counts down the columns.
        values = file.vector(data).reshape(data.shape, order="F")
    except TextureError as error:
        raise SpectrumError(error.problem, where=path, remedy=_REMEDY) from None
    if len(values) != len(wavelengths):
        raise SpectrumError(
            f"'data' has {len(values)} rows for {len(wavelengths)} wavelengths", where=path, remedy=_REMEDY
        )
    return wavelengths, np.ascontiguousarray(values.T)


def _numbers(found: dict[str, Variable], name: str, path: Path) -> Variable:
    if name not in found:
        others = ", ".join(each[:60] for each in list(found)[:6]) or "no numbers"
        raise SpectrumError(f"has no variable '{name}' of numbers, only {others}", where=path, remedy=_REMEDY)
    variable = found[name]
    if len(variable.shape) != 2 or not 0 < math.prod(variable.shape) <= _MOST_NUMBERS:
        shape = " x ".join(map(str, variable.shape))
        raise SpectrumError(f"'{name}' has shape {shape}", where=path, remedy=_REMEDY)
    return variable
