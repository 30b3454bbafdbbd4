"""Writing hyperspectral textures a few rows at a time, as `open_texture` reads them.

Half floats have eleven binary digits: a reflectance is rounded by at most 1 part in 4096 of itself, which
no eye sees.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import OutputError
from spectral_core.files import atomic_path
from spectral_core.imaging import error_text, oiio
from spectral_core.textures.base import Samples

SUFFIXES = (".npz", ".npy", ".exr")


class TextureWriter(Protocol):
    """Takes a texture from the top down."""

    def write(self, rows: Samples) -> None:
        """Append rows (count, width, bands)."""


def writable_suffix(path: str | Path) -> str:
    """The suffix of a texture that can be written.

    Raises
    ------
    OutputError
        If it is none of `SUFFIXES`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError(
            f"'{suffix}' is no format that textures are written in", where=path, remedy=f"use {', '.join(SUFFIXES)}"
        )
    return suffix


@contextmanager
def texture_writer(
    path: str | Path, height: int, width: int, wavelengths_nm: Float64Array, half: bool = True
) -> Iterator[TextureWriter]:
    """A writer of a texture of reflectance: ``.npz``, ``.npy`` with its wavelengths beside it, or spectral ``.exr``.

    The file is there when the block ends without error, and untouched otherwise.

    Raises
    ------
    OutputError
        If the suffix is none of these, or the file cannot be written.
    """
    path, make = Path(path), {".npz": _npz, ".npy": _npy, ".exr": _exr}[writable_suffix(path)]
    with ExitStack() as stack:
        temporary = stack.enter_context(atomic_path(path))
        writer = stack.enter_context(
            make(temporary, (height, width, len(wavelengths_nm)), wavelengths_nm, "float16" if half else "float32")
        )
        if writable_suffix(path) == ".npy":
            beside = stack.enter_context(atomic_path(path.with_name(f"{path.stem}.wavelengths.csv")))
            text = "\n".join(repr(float(nm)) for nm in wavelengths_nm)
            beside.write_text(f"# nm\n{text}\n", encoding="utf-8")
        try:
            yield writer
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror})", where=path, remedy="is the disk full?") from None


class _Stream:
    """Rows as they are, into a stream that has its header."""

    def __init__(self, stream: IO[bytes], dtype: str) -> None:
        self._stream, self._dtype = stream, dtype

    def write(self, rows: Samples) -> None:
        self._stream.write(np.ascontiguousarray(rows, dtype=self._dtype).data)


def _header(stream: IO[bytes], shape: tuple[int, ...], dtype: str) -> None:
    form: Any = np.lib.format
    form.write_array_header_1_0(
        stream, {"descr": form.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
    )


@contextmanager
def _npy(path: Path, shape: tuple[int, int, int], wavelengths_nm: Float64Array, dtype: str) -> Iterator[TextureWriter]:
    with path.open("wb") as stream:
        _header(stream, shape, dtype)
        yield _Stream(stream, dtype)


@contextmanager
def _npz(path: Path, shape: tuple[int, int, int], wavelengths_nm: Float64Array, dtype: str) -> Iterator[TextureWriter]:
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("wavelengths_nm.npy", "w") as stream:
            np.save(stream, np.asarray(wavelengths_nm, dtype=np.float64))
        # Larger than 4 GB, perhaps: a member of unknown size must say so first.
        with archive.open("reflectance.npy", "w", force_zip64=True) as stream:
            _header(stream, shape, dtype)
            yield _Stream(stream, dtype)


class _Exr:
    """Spectral OpenEXR, layout 1.0 (Fichet, Pacanowski, Wilkie 2021), through OpenImageIO."""

    def __init__(self, path: Path, shape: tuple[int, int, int], wavelengths_nm: Float64Array, dtype: str) -> None:
        self._path, self._row = path, 0
        self._dtype = dtype
        spec = oiio().ImageSpec(shape[1], shape[0], shape[2], "half" if dtype == "float16" else "float")
        spec.channelnames = tuple(f"T.{f'{nm:.6f}'.replace('.', ',')}nm" for nm in wavelengths_nm)
        spec.attribute("spectralLayoutVersion", "1.0")
        # Level 4 takes twice as long for a twentieth less.
        spec.attribute("compression", "zip:1")
        self._output: Any = oiio().ImageOutput.create(str(path))
        if self._output is None or not self._output.open(str(path), spec):
            raise self._failed(self._output if self._output is not None else oiio())

    def write(self, rows: Samples) -> None:
        count = len(rows)
        values = np.ascontiguousarray(rows, dtype=self._dtype)
        if not self._output.write_scanlines(self._row, self._row + count, 0, values):
            raise self._failed(self._output)
        self._row += count

    def close(self) -> None:
        if not self._output.close():
            raise self._failed(self._output)

    def _failed(self, source: Any) -> OutputError:
        return OutputError(f"cannot be written ({error_text(source)})", where=self._path, remedy="is the disk full?")


@contextmanager
def _exr(path: Path, shape: tuple[int, int, int], wavelengths_nm: Float64Array, dtype: str) -> Iterator[TextureWriter]:
    writer = _Exr(path, shape, wavelengths_nm, dtype)
    yield writer
    writer.close()
