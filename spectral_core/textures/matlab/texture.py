"""MATLAB files: which of their arrays is the texture, and which one holds its wavelengths.

Version 5 to 7 files are read here (`matlab_v5`), version 7.3 ones are HDF5 (`matlab_hdf5`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples, checked_wavelengths
from spectral_core.textures.matlab.file import MatFile, Variable
from spectral_core.textures.matlab.hdf5 import Mat73File
from spectral_core.textures.matlab.v5 import Mat5File
from spectral_core.textures.reading import Reading, stated_kind, stated_wavelengths
from spectral_core.textures.wavelengths import as_nanometres, ask_for_wavelengths
from spectral_core.weights import LARGEST_BANDS

# As people spell it: wavelength(s), wavlength, wave, wl, lambda, bands, nm.
_NAMED_WAVELENGTHS = re.compile(
    r"(.*_)?(wave?_?(s|lengths?|len|nums?)?|w[lv]s?|lambdas?|lam|bands?|nm)(_?(nm|um|list|vector|axis))?", re.IGNORECASE
)
_NAMED_KINDS: dict[Kind, re.Pattern[str]] = {
    "reflectance": re.compile(r"reflectances?", re.IGNORECASE),
    "radiance": re.compile(r"radiances?", re.IGNORECASE),
}
_LISTED = 8  # of names in messages


class MatlabTexture(HyperspectralTexture):
    """A three-dimensional array (height, width, bands) of a MATLAB file.

    Raises
    ------
    TextureError
        If the file is damaged, holds none or several such arrays and nobody says which, or does not say
        its wavelengths.
    MissingExtraError
        If it is of version 7.3 and h5py is not installed.
    """

    def __init__(self, path: Path, reading: Reading) -> None:
        file = open_mat_file(path)
        cube = _chosen(file.variables, reading, path)
        self.format = file.format
        self.name, self.part = path.stem, cube.name
        self.height, self.width, _ = cube.shape
        wavelengths, self.warnings = _wavelengths(file, cube, reading, path)
        self.wavelengths_nm = frozen(wavelengths)
        self.kind, self.scale = stated_kind(path, reading, cube.dtype, _kind_of(cube.name))
        self._rows, self.concurrent = file.rows(cube)

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands)."""
        return self._rows(first, count)


def open_mat_file(path: Path) -> MatFile:
    """The reader for a file, known by its first bytes."""
    with path.open("rb") as stream:
        return Mat5File(path) if stream.read(8) == b"MATLAB 5" else Mat73File(path)


def _chosen(variables: Sequence[Variable], reading: Reading, path: Path) -> Variable:
    cubes = [each for each in variables if len(each.shape) == 3 and 0 not in each.shape]
    if reading.variable is not None:
        named = [each for each in cubes if each.name == reading.variable]
        if len(named) == 1:
            cubes = named
        else:
            raise TextureError(
                f"holds no array '{reading.variable[:80]}' of shape (height, width, bands)",
                where=path,
                remedy=f"give --variable, one of {_listed(cubes)}" if cubes else "give another file",
            )
    if len(cubes) > 1:
        raise TextureError(
            f"holds {len(cubes)} arrays that could be the texture",
            where=path,
            remedy=f"give --variable: {_listed(cubes)}",
        )
    if not cubes:
        raise TextureError(
            f"holds no numeric array of shape (height, width, bands), only {_listed(variables) or 'others'}",
            where=path,
            remedy="save one",
        )
    if cubes[0].shape[2] > LARGEST_BANDS:
        raise TextureError(
            f"'{cubes[0].name}' has {cubes[0].shape[2]} bands, more than {LARGEST_BANDS}",
            where=path,
            remedy="its axes must be height, width, bands",
        )
    return cubes[0]


def _listed(variables: Sequence[Variable]) -> str:
    names = [f"{each.name[:60]} {' x '.join(map(str, each.shape))}" for each in variables[:_LISTED]]
    more = len(variables) - len(names)
    return ", ".join(names) + (f" and {more} more" if more else "")


def _kind_of(name: str) -> Kind | None:
    last = name.rsplit(".", 1)[-1]
    return next((kind for kind, pattern in _NAMED_KINDS.items() if pattern.fullmatch(last)), None)


def _wavelengths(file: MatFile, cube: Variable, reading: Reading, path: Path) -> tuple[Float64Array, tuple[str, ...]]:
    """Wavelengths (bands,) in nm: what the user says, else the only vector whose name or values say so.

    Raises
    ------
    TextureError
        If there is none or there are several.
    """
    bands = cube.shape[2]
    stated = stated_wavelengths(reading, bands, path)
    if stated is not None:
        return stated, ()
    vectors = [each for each in file.variables if each.shape and max(each.shape) == bands == np.prod(each.shape)]
    named = [each for each in vectors if _NAMED_WAVELENGTHS.fullmatch(each.name.rsplit(".", 1)[-1])]
    for candidates, by_name in ((named, True), (vectors, False)):
        found = {each.name: values for each in candidates if (values := _light(file.vector(each), by_name)) is not None}
        if len(found) > 1:
            raise ask_for_wavelengths(
                path, bands, f"holds several vectors that could be the wavelengths ({', '.join(list(found)[:_LISTED])})"
            )
        for name, values in found.items():
            warning = f"wavelengths {values[0]:g} to {values[-1]:g} nm from '{name}'"
            return checked_wavelengths(values, bands, path), (warning,)
    raise ask_for_wavelengths(path, bands)


def _light(values: Float64Array, by_name: bool) -> Float64Array | None:
    """A vector in nm if it can be wavelengths; without a telling name it must rise or fall, unlike counts."""
    found = as_nanometres(values)
    if found is None or by_name:
        return found
    steps = np.diff(values)
    rises = (steps > 0).all() or (steps < 0).all()
    return found if found is values and rises and not (np.abs(steps) == 1).all() else None
