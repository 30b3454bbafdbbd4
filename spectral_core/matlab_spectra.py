"""Tables of spectra in MATLAB files: variables ``data`` and ``wavelength``, as ISETCam's reflectances have.

The format is that of version 5 to 7 (MAT-File Format, MathWorks): tagged elements, of which only these two are
read. scipy's reader is not used: it can be made to crash by damaged files.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import SpectrumError

# The text that every MATLAB file since version 5 begins with.
SIGNATURE = b"MATLAB "
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
# Types of stored numbers, by their code in a tag.
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
# Classes of arrays of numbers: double to uint64.
_NUMBERS = range(6, 16)
_COMPLEX = 0x800
_WANTED = ("data", "wavelength")
# Far more than any library of reflectances.
_LARGEST_BYTES = 64 << 20
_MOST_VARIABLES = 1000
# Enough of a compressed variable to know its name.
_NAME_WITHIN = 512
_REMEDY = "give variables 'data', one column a spectrum, and 'wavelength' in nm"


class _Element(NamedTuple):
    """A tagged element: its type, what it holds, and where the next one begins."""

    kind: int
    content: memoryview
    end: int


def matlab_table(path: Path) -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) and values (spectra, n) as they stand in the file.

    Raises
    ------
    SpectrumError
        If it is damaged, or does not hold these variables.
    """
    if path.stat().st_size > _LARGEST_BYTES:
        raise SpectrumError("is far too large for a table of spectra", where=path, remedy=_REMEDY)
    content = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:_HEADER])
    if content[:10] == b"MATLAB 7.3":
        raise SpectrumError("is a MATLAB 7.3 file", where=path, remedy="save it with -v7, or as CSV")
    if order is None:
        raise SpectrumError("is a damaged MATLAB file (no byte order)", where=path, remedy=_REMEDY)
    try:
        found = dict(_variables(memoryview(content), order))
    except (struct.error, zlib.error, ValueError, IndexError) as error:
        raise SpectrumError(f"is a damaged MATLAB file ({str(error)[:80]})", where=path, remedy=_REMEDY) from None
    missing = [name for name in _WANTED if name not in found]
    if missing:
        raise SpectrumError(f"has no variable '{missing[0]}'", where=path, remedy=_REMEDY)
    wavelengths, values = found["wavelength"].ravel(), found["data"]
    if values.shape[0] != len(wavelengths):
        raise SpectrumError(
            f"'data' has {values.shape[0]} rows for {len(wavelengths)} wavelengths", where=path, remedy=_REMEDY
        )
    return wavelengths, np.ascontiguousarray(values.T)


def _variables(content: memoryview, order: str) -> Iterator[tuple[str, Float64Array]]:
    """The wanted variables of a file; ValueError for whatever is wrong."""
    at = _HEADER
    for _ in range(_MOST_VARIABLES):
        if at + 8 > len(content):
            return
        element = _element(content, at, order)
        at = element.end
        if element.kind == _COMPRESSED:
            start = memoryview(zlib.decompressobj().decompress(element.content, _NAME_WITHIN))
            if _name(start[8:], order) not in _WANTED:
                continue
            whole = memoryview(zlib.decompressobj().decompress(element.content, _LARGEST_BYTES))
            element = _element(whole, 0, order)
        if element.kind == _MATRIX and (name := _name(element.content, order)) in _WANTED:
            yield name, _matrix(name, element.content, order)


def _element(content: memoryview, at: int, order: str) -> _Element:
    kind, size = struct.unpack_from(f"{order}II", content, at)
    if kind >> 16:  # four bytes or fewer stand in the tag itself
        kind, size, first, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
        if size > 4:
            raise ValueError("an element of more than its tag")
    else:
        first = at + 8
        end = first + size if kind == _COMPRESSED else first + size + -size % 8
    if first + size > len(content):
        raise ValueError("cut short")
    return _Element(kind, content[first : first + size], end)


def _parts(matrix: memoryview, order: str) -> tuple[_Element, _Element, _Element]:
    """Flags, dimensions and name of a matrix."""
    flags = _element(matrix, 0, order)
    sizes = _element(matrix, flags.end, order)
    return flags, sizes, _element(matrix, sizes.end, order)


def _name(matrix: memoryview, order: str) -> str:
    return bytes(_parts(matrix, order)[2].content).decode("latin-1")


def _matrix(name: str, matrix: memoryview, order: str) -> Float64Array:
    """A matrix of real numbers (rows, columns)."""
    flags, sizes, named = _parts(matrix, order)
    (flag,) = struct.unpack_from(f"{order}I", flags.content)
    if flag & 0xFF not in _NUMBERS or flag & _COMPLEX:
        raise ValueError(f"'{name}' holds no real numbers")
    if len(sizes.content) != 8:
        raise ValueError(f"'{name}' is no matrix")
    shape = struct.unpack(f"{order}2i", sizes.content)
    real = _element(matrix, named.end, order)
    if real.kind not in _STORED or min(shape) < 1:
        raise ValueError(f"'{name}' holds no numbers")
    numbers = np.frombuffer(real.content, dtype=f"{order}{_STORED[real.kind]}")
    if len(numbers) != math.prod(shape):
        raise ValueError(f"'{name}' has {len(numbers)} numbers for {shape[0]} x {shape[1]}")
    return np.asarray(numbers.reshape(shape, order="F"), dtype=np.float64)
