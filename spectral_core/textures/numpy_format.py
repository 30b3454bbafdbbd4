"""Textures in NumPy's own formats.

``.npz`` holds ``reflectance`` (or ``radiance``), (height, width, bands), and ``wavelengths_nm``,
(bands,). ``.npy`` holds the cube alone; its wavelengths stand in ``NAME.wavelengths.csv`` beside
it, one a line, and it is reflectance. Integers are refused: a count is not a reflectance.
"""

from __future__ import annotations

import lzma
import math
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.files import read_text
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples, checked_wavelengths
from spectral_core.textures.reading import Reading
from spectral_core.weights import LARGEST_BANDS

# NumPy types these functions in some versions only.
_FORMAT: Any = np.lib.format
_LARGEST_SIDE = 1 << 20
# What a damaged or hostile archive makes zipfile and its decompressors raise.
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError, KeyError, ValueError,
    OverflowError,
)  # fmt: skip


class NpyTexture(HyperspectralTexture):
    """A memory-mapped ``.npy`` cube with its wavelengths in a file beside it."""

    format = "npy"
    kind: Kind = "reflectance"
    concurrent = True

    def __init__(self, path: Path, reading: Reading) -> None:
        with path.open("rb") as stream:
            shape, fortran, dtype = _header(stream, path)
            offset = stream.tell()
        _check_cube(shape, dtype, path)
        _check_size(path.stat().st_size - offset, shape, dtype, path)
        self._cube = np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape, order="F" if fortran else "C")
        self.name = path.stem
        self.height, self.width, bands = shape
        self.wavelengths_nm = frozen(_wavelengths_beside(path, bands))

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands)."""
        return self._cube[first : first + count]


class NpzTexture(HyperspectralTexture):
    """A ``.npz`` archive, compressed or not, streamed from its member without unpacking it whole."""

    format = "npz"

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path = path
        self._next_row = 0
        self._stream: IO[bytes] | None = None
        try:
            with zipfile.ZipFile(path) as archive:
                members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
                self._member, self.kind = _cube_member(members, path)
                self._shape, fortran, self._dtype = self._read_header(archive, members[self._member])
                _check_cube(self._shape, self._dtype, path)
                if fortran:
                    raise TextureError(
                        "the cube is in Fortran order, which cannot be streamed",
                        where=path,
                        remedy="save numpy.ascontiguousarray of it",
                    )
                wavelengths = _small_array(archive, members, path)
        except _DAMAGE as error:
            raise _damaged(error, path) from None
        self.name = path.stem
        self.height, self.width, bands = self._shape
        self.wavelengths_nm = frozen(checked_wavelengths(wavelengths, bands, path))

    def _read_header(
        self, archive: zipfile.ZipFile, info: zipfile.ZipInfo
    ) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
        with archive.open(info) as stream:
            shape, fortran, dtype = _header(stream, self._path)
            _check_cube(shape, dtype, self._path)
            _check_size(info.file_size - stream.tell(), shape, dtype, self._path)
        return shape, fortran, dtype

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands). Fast from the top down."""
        row_bytes = self.width * self.bands * self._dtype.itemsize
        try:
            if self._stream is None or first < self._next_row:
                self.close()
                archive = zipfile.ZipFile(self._path)
                self._stream = archive.open(f"{self._member}.npy")
                _header(self._stream, self._path)
                self._next_row = 0
            self._stream.seek((first - self._next_row) * row_bytes, 1)
            data = self._stream.read(count * row_bytes)
        except _DAMAGE as error:
            raise _damaged(error, self._path) from None
        if len(data) < count * row_bytes:
            raise TextureError(
                f"ends in row {first + len(data) // row_bytes}", where=self._path, remedy="write it again"
            )
        self._next_row = first + count
        return np.frombuffer(data, dtype=self._dtype).reshape(count, self.width, self.bands)

    def close(self) -> None:
        """Close the archive; the next read opens it again."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None


def _damaged(error: Exception, path: Path) -> TextureError:
    """Messages of zipfile may quote names of the archive, of any length."""
    return TextureError(f"is a damaged archive ({str(error)[:120]})", where=path, remedy="write it again")


def _header(stream: IO[bytes], path: Path) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type of an array file, without evaluating or allocating anything of it."""
    try:
        version = _FORMAT.read_magic(stream)
        read = _FORMAT.read_array_header_1_0 if version == (1, 0) else _FORMAT.read_array_header_2_0
        shape, fortran, dtype = read(stream)
    except Exception as error:  # the header is Python text: its parser raises what Python's does
        raise TextureError(
            f"has a damaged NumPy header ({next(iter(str(error).splitlines()), type(error).__name__)})",
            where=path,
            remedy="write it again",
        ) from None
    return shape, fortran, dtype


def _check_cube(shape: tuple[int, ...], dtype: np.dtype[Any], path: Path) -> None:
    if len(shape) != 3 or not all(0 < side <= _LARGEST_SIDE for side in shape) or shape[2] > LARGEST_BANDS:
        raise TextureError(f"holds an array of shape {shape}", where=path, remedy="give (height, width, bands)")
    if dtype.hasobject or dtype.kind != "f":
        raise TextureError(
            f"holds values of type {dtype}, not floating point",
            where=path,
            remedy="divide counts by the white reference and save float32",
        )


def _check_size(available: int, shape: tuple[int, ...], dtype: np.dtype[Any], path: Path) -> None:
    promised = math.prod(shape) * dtype.itemsize
    if available < promised:
        raise TextureError(
            f"the header promises {promised:,} bytes for {shape}, the file holds {max(available, 0):,}",
            where=path,
            remedy="the file is cut short; copy or write it again",
        )


def _cube_member(members: dict[str, zipfile.ZipInfo], path: Path) -> tuple[str, Kind]:
    kinds: tuple[Kind, ...] = ("reflectance", "radiance")
    for kind in kinds:
        if kind in members:
            return kind, kind
    raise TextureError(
        f"holds {', '.join(sorted(members)[:6]) or 'nothing'}",
        where=path,
        remedy="save it as numpy.savez(file, reflectance=..., wavelengths_nm=...)",
    )


def _small_array(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], path: Path) -> Float64Array:
    info = members.get("wavelengths_nm")
    if info is None:
        raise TextureError("lacks the array 'wavelengths_nm'", where=path, remedy="save one wavelength in nm per band")
    if info.file_size > 16 * LARGEST_BANDS + 4096:
        raise TextureError("'wavelengths_nm' is far too large", where=path, remedy="save one wavelength in nm per band")
    with archive.open(info) as stream:
        shape, _, dtype = _header(stream, path)
        if dtype.kind not in "fiu":
            raise TextureError(f"'wavelengths_nm' is of type {dtype}", where=path, remedy="save plain numbers")
        _check_size(info.file_size - stream.tell(), shape, dtype, path)
        data = stream.read(math.prod(shape) * dtype.itemsize)
    return np.asarray(np.frombuffer(data, dtype=dtype), dtype=np.float64).reshape(shape)


def _wavelengths_beside(path: Path, bands: int) -> Float64Array:
    beside = path.with_name(f"{path.stem}.wavelengths.csv")
    if not beside.is_file():
        raise TextureError(
            "an .npy file does not say its wavelengths",
            where=path,
            remedy=f"write {beside.name} beside it, one wavelength in nm a line, or save .npz",
        )
    text = read_text(beside, TextureError, "give one wavelength in nm a line")
    try:
        values = [float(line) for line in text.splitlines() if line.strip() and not line.startswith("#")]
    except ValueError as error:
        raise TextureError(
            f"holds something that is no number ({error})", where=beside, remedy="give one wavelength in nm a line"
        ) from None
    return checked_wavelengths(np.array(values), bands, beside)
