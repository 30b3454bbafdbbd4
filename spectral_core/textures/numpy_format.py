"""Textures in NumPy's own formats.

``.npz`` holds ``reflectance``, ``radiance`` or ``counts``, (height, width, bands), ``wavelengths_nm``,
(bands,), and perhaps ``scale``, the stored value of reflectance 1. ``.npy`` holds the cube alone; its
wavelengths stand in ``NAME.wavelengths.csv`` beside it, one a line, and floating point is reflectance.
Integers need a scale to be reflectance: they are counts otherwise.
"""

from __future__ import annotations

import io
import lzma
import math
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples, checked_wavelengths
from spectral_core.textures.reading import Reading, stated_kind, stated_wavelengths, wavelengths_in_file
from spectral_core.weights import LARGEST_BANDS

# NumPy types these functions in some versions only.
_FORMAT: Any = np.lib.format
_LARGEST_SIDE = 1 << 20
_LONGEST_HEADER = 10_000  # of NumPy itself
# What a damaged or hostile archive makes zipfile and its decompressors raise.
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError, KeyError, ValueError,
    OverflowError,
)  # fmt: skip


class NpyTexture(HyperspectralTexture):
    """A memory-mapped ``.npy`` cube with its wavelengths in a file beside it."""

    format = "npy"
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
        self.wavelengths_nm = frozen(_wavelengths_beside(path, bands, reading))
        self.kind, self.scale = stated_kind(path, reading, dtype, "reflectance" if dtype.kind == "f" else None)

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
                self._member, *others = _cube_members(members, reading, path)
                self._shape, fortran, self._dtype = self._read_header(archive, members[self._member])
                _check_cube(self._shape, self._dtype, path)
                if fortran:
                    raise TextureError(
                        "the cube is in Fortran order, which cannot be streamed",
                        where=path,
                        remedy="save numpy.ascontiguousarray of it",
                    )
                wavelengths = stated_wavelengths(reading, self._shape[2], path)
                if wavelengths is None:
                    wavelengths = _wavelengths_inside(archive, members, path)
                scale = _scale_inside(archive, members, path)
        except _DAMAGE as error:
            raise _damaged(error, path) from None
        self.name, self.part = path.stem, self._member
        self.height, self.width, bands = self._shape
        self.wavelengths_nm = frozen(checked_wavelengths(wavelengths, bands, path))
        self.kind, self.scale = stated_kind(path, reading, self._dtype, self._member, scale)
        self.warnings = tuple(f"{self._member} is used; it holds {other} as well" for other in others)
        if scale is not None and self.kind != "reflectance":
            self.warnings += (f"its scale of {scale:g} is not used: it is for reflectance, and this is {self.kind}",)

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
                with zipfile.ZipFile(self._path) as archive:  # the member keeps its file open
                    self._stream = archive.open(f"{self._member}.npy")
                _header(self._stream, self._path)
                self._next_row = 0
            self._stream.seek((first - self._next_row) * row_bytes, 1)
            data = self._stream.read(count * row_bytes)
        except _DAMAGE as error:
            self.close()
            raise _damaged(error, self._path) from None
        if len(data) < count * row_bytes:
            raise TextureError(
                f"ends in row {first + len(data) // row_bytes}", where=self._path, remedy="write it again"
            )
        self._next_row = first + count
        if self._next_row >= self.height:
            self.close()
        return np.frombuffer(data, dtype=self._dtype).reshape(count, self.width, self.bands)

    def close(self) -> None:
        """Let go of the archive; the next read opens it again."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None


def _damaged(error: Exception, path: Path) -> TextureError:
    """Messages of zipfile may quote names of the archive, of any length."""
    return TextureError(f"is a damaged archive ({str(error)[:120]})", where=path, remedy="write it again")


def _header(stream: IO[bytes], path: Path) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type of an array file, without evaluating or allocating anything of it."""
    try:
        head = stream.read(8)
        size_bytes = 2 if head[6:7] == b"\x01" else 4
        head += stream.read(size_bytes)
        length = int.from_bytes(head[8:], "little")
        if length > _LONGEST_HEADER:  # before it is allocated
            raise ValueError(f"a header of {length:,} bytes")
        whole = io.BytesIO(head + stream.read(length))
        version = _FORMAT.read_magic(whole)
        read = _FORMAT.read_array_header_1_0 if version == (1, 0) else _FORMAT.read_array_header_2_0
        shape, fortran, dtype = read(whole)
    except Exception as error:  # the header is Python text: its parser raises what Python's does
        raise TextureError(
            f"has a damaged NumPy header ({next(iter(str(error).splitlines()), type(error).__name__)[:120]})",
            where=path,
            remedy="write it again",
        ) from None
    return shape, fortran, dtype


def _check_cube(shape: tuple[int, ...], dtype: np.dtype[Any], path: Path) -> None:
    if len(shape) != 3 or not all(0 < side <= _LARGEST_SIDE for side in shape) or shape[2] > LARGEST_BANDS:
        raise TextureError(f"holds an array of shape {shape}", where=path, remedy="give (height, width, bands)")
    if dtype.hasobject or dtype.kind not in "fiu":
        raise TextureError(
            f"holds values of type {str(dtype)[:80]}, not real numbers", where=path, remedy="save float32 or integers"
        )


def _check_size(available: int, shape: tuple[int, ...], dtype: np.dtype[Any], path: Path) -> None:
    promised = math.prod(shape) * dtype.itemsize
    if available < promised:
        raise TextureError(
            f"the header promises {promised:,} bytes for {shape}, the file holds {max(available, 0):,}",
            where=path,
            remedy="the file is cut short; copy or write it again",
        )


def _cube_members(members: dict[str, zipfile.ZipInfo], reading: Reading, path: Path) -> list[Kind]:
    """The members that hold cubes, each named by its kind: the one to take first."""
    kinds: tuple[Kind, ...] = ("reflectance", "radiance", "counts")
    found = sorted((kind for kind in kinds if kind in members), key=lambda kind: kind != reading.kind)
    if not found:
        raise TextureError(
            f"holds {', '.join(name[:40] for name in sorted(members)[:6]) or 'nothing'}",
            where=path,
            remedy="save it as numpy.savez(file, reflectance=..., wavelengths_nm=...), or radiance=, or counts=",
        )
    return found


def _wavelengths_inside(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], path: Path) -> Float64Array:
    if "wavelengths_nm" not in members:
        raise TextureError(
            "lacks the array 'wavelengths_nm'", where=path, remedy="save one wavelength in nm per band, or give them"
        )
    return _small_array(archive, members["wavelengths_nm"], path)


def _scale_inside(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], path: Path) -> float | None:
    if "scale" not in members:
        return None
    values = _small_array(archive, members["scale"], path)
    if values.size != 1:
        raise TextureError(f"'scale' holds {values.size} numbers", where=path, remedy="save one: that of reflectance 1")
    try:
        return Reading(scale=float(values.reshape(-1)[0])).scale
    except TextureError as error:
        raise TextureError(f"'scale' in it: {error.problem}", where=path, remedy=error.remedy) from None


def _small_array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> Float64Array:
    name = info.filename.removesuffix(".npy")
    if info.file_size > 16 * LARGEST_BANDS + 4096:
        raise TextureError(f"'{name}' is far too large", where=path, remedy="save one number per band")
    with archive.open(info) as stream:
        shape, _, dtype = _header(stream, path)
        if dtype.kind not in "fiu":
            raise TextureError(f"'{name}' is of type {str(dtype)[:80]}", where=path, remedy="save plain numbers")
        _check_size(info.file_size - stream.tell(), shape, dtype, path)
        data = stream.read(math.prod(shape) * dtype.itemsize)
    return np.asarray(np.frombuffer(data, dtype=dtype), dtype=np.float64).reshape(shape)


def _wavelengths_beside(path: Path, bands: int, reading: Reading) -> Float64Array:
    """What the user says, else what the file beside it says."""
    stated = stated_wavelengths(reading, bands, path)
    if stated is not None:
        return stated
    beside = path.with_name(f"{path.stem}.wavelengths.csv")
    if not beside.is_file():
        raise TextureError(
            "an .npy file does not say its wavelengths",
            where=path,
            remedy=f"give --wavelengths, write {beside.name} beside it, one in nm a line, or save .npz",
        )
    return checked_wavelengths(wavelengths_in_file(beside), bands, beside)
