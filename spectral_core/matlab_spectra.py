"""Tables of spectra in MATLAB files: variables ``data`` and ``wavelength``, as ISETCam's reflectances have."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import MissingExtraError, SpectrumError

# The text that every MATLAB file since version 5 begins with.
SIGNATURE = b"MATLAB "
_HDF5 = b"MATLAB 7.3"
_NUMBERS = ("double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
# 64 MB of float64: far more than any library.
_MOST_NUMBERS = 8 << 20
_LARGEST_BYTES = 64 << 20
_REMEDY = "give variables 'data', one column a spectrum, and 'wavelength' in nm"


def matlab_table(path: Path) -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) and values (spectra, n) as they stand in the file.

    Raises
    ------
    SpectrumError
        If it is damaged, or does not hold these variables.
    MissingExtraError
        Without scipy.
    """
    try:
        import scipy.io
    except ImportError:
        raise MissingExtraError(
            "MATLAB files need scipy", where=path, remedy="pip install scipy, or give a CSV"
        ) from None
    with path.open("rb") as stream:
        if stream.read(len(_HDF5)) == _HDF5:
            raise SpectrumError("is a MATLAB 7.3 file", where=path, remedy="save it with -v7, or as CSV")
    if path.stat().st_size > _LARGEST_BYTES:
        raise SpectrumError("is far too large for a table of spectra", where=path, remedy=_REMEDY)
    try:
        # Names, shapes and types first: nothing is allocated for what is too large or no numbers.
        listed = {name: (shape, kind) for name, shape, kind in scipy.io.whosmat(path)}
        _check(listed, path)
        found: dict[str, Any] = scipy.io.loadmat(path, variable_names=["data", "wavelength"])
        wavelengths, data = found["wavelength"], found["data"]
        return _oriented(np.asarray(wavelengths).ravel(), np.asarray(data), path)
    except (SpectrumError, MissingExtraError):
        raise
    except Exception as error:  # scipy's reader raises what Python's own do
        text = " ".join(str(error).split())[:120]
        raise SpectrumError(
            f"is a damaged MATLAB file ({text or type(error).__name__})", where=path, remedy=_REMEDY
        ) from None


def _check(listed: dict[str, tuple[tuple[int, ...], str]], path: Path) -> None:
    for name in ("data", "wavelength"):
        if name not in listed:
            others = ", ".join(sorted(listed)[:6]) or "nothing"
            raise SpectrumError(f"has no variable '{name}', only {others}", where=path, remedy=_REMEDY)
        shape, kind = listed[name]
        if kind not in _NUMBERS:
            raise SpectrumError(f"'{name}' is of type {kind}", where=path, remedy=_REMEDY)
        if len(shape) != 2 or not 0 < math.prod(shape) <= _MOST_NUMBERS:
            raise SpectrumError(f"'{name}' has shape {' x '.join(map(str, shape))}", where=path, remedy=_REMEDY)


def _oriented(wavelengths: Any, data: Any, path: Path) -> tuple[Float64Array, Float64Array]:
    if np.iscomplexobj(wavelengths) or np.iscomplexobj(data):
        raise SpectrumError("holds complex numbers", where=path, remedy=_REMEDY)
    if data.ndim != 2 or data.shape[0] != len(wavelengths):
        raise SpectrumError(
            f"'data' has {data.shape[0]} rows for {len(wavelengths)} wavelengths", where=path, remedy=_REMEDY
        )
    return np.asarray(wavelengths, dtype=np.float64), np.asarray(data.T, dtype=np.float64)
