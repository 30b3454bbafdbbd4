"""MATLAB files of version 7.3, which are HDF5, through h5py.

MATLAB writes its axes in reverse: (height, width, bands) is (bands, width, height) there. Only what lies
in the file itself is read: no links to other files, no data of theirs, no references.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import MissingExtraError, SpectralBoothError, TextureError
from spectral_core.textures.base import Samples
from spectral_core.textures.images.row_buffer import RowBuffer, block_rows
from spectral_core.textures.matlab.file import Variable

_CLASSES = {
    "double": "f8", "single": "f4", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4",
    "uint32": "u4", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_MOST_ARRAYS = 10_000
_DEEPEST = 16
# Deflate packs nothing more densely.
_LARGEST_RATIO = 1032
# Rows of whole chunks are unpacked at once up to this; where it is exceeded chunks are unpacked repeatedly.
_LARGEST_BLOCK = 1 << 30


class Mat73File:
    """The numeric arrays of a file, also those in structs.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    TextureError
        If it is damaged.
    """

    format = "MATLAB v7.3"

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            import h5py
        except ImportError:
            raise MissingExtraError(
                "a MATLAB file of version 7.3 needs h5py, which is not installed",
                where=path,
                remedy="pip install 'spectral-booth[matlab]', or save it with -v7 in MATLAB",
            ) from None
        self._h5py = h5py
        self._datasets: dict[Variable, Any] = {}
        with self._damage():
            self._file = h5py.File(path, "r")
            self._visit(self._file, "", 0)
        self.variables = tuple(self._datasets)

    def rows(self, cube: Variable) -> tuple[Callable[[int, int], Samples], bool]:
        """Views of the file if the array lies there in one piece, else blocks of whole chunks."""
        dataset = self._datasets[cube]
        with self._damage():
            self._check(dataset, cube)
            offset = None if dataset.chunks else dataset.id.get_offset()
            chunk = dataset.chunks
        if offset is not None and offset + dataset.nbytes <= self._path.stat().st_size:
            values = np.memmap(self._path, dataset.dtype, "r", offset, dataset.shape).transpose()
            return lambda first, count: values[first : first + count], True

        def read(first: int, count: int) -> Samples:
            with self._damage():
                block: Samples = dataset[:, :, first : first + count]
            return block.transpose()

        height, width, bands = cube.shape
        row_bytes = width * bands * dataset.dtype.itemsize
        rows = block_rows(row_bytes, chunk[2] if chunk else 1)
        return RowBuffer(read, height, min(rows, max(1, _LARGEST_BLOCK // row_bytes))).rows, False

    def vector(self, variable: Variable) -> Float64Array:
        """All numbers of a small array, in MATLAB's order."""
        with self._damage():
            self._check(self._datasets[variable], variable)
            return np.asarray(self._datasets[variable][()], dtype=np.float64).ravel()

    def _visit(self, group: Any, prefix: str, depth: int) -> None:
        """Note the arrays of a group and of the structs in it."""
        for key in group:
            if key.startswith("#"):  # what references of cells point to
                continue
            if not isinstance(group.get(key, getlink=True), self._h5py.HardLink):
                continue
            kind = group.get(key, getclass=True)
            name = f"{prefix}{key.encode('ascii', 'replace').decode()}"
            if kind is self._h5py.Group and depth < _DEEPEST:
                self._visit(group[key], f"{name}.", depth + 1)
            elif kind is self._h5py.Dataset:
                self._note(group[key], name)
            if len(self._datasets) > _MOST_ARRAYS:
                raise ValueError(f"more than {_MOST_ARRAYS} arrays")

    def _note(self, dataset: Any, name: str) -> None:
        """Only arrays that MATLAB wrote: the axes of others may be in any order."""
        matlab_class = dataset.attrs.get("MATLAB_class")
        if not isinstance(matlab_class, bytes) or dataset.dtype.kind not in "fiu" or "MATLAB_empty" in dataset.attrs:
            return
        dtype = _CLASSES.get(matlab_class.decode("ascii", "replace"))
        if dtype is not None:
            self._datasets[Variable(name, tuple(map(int, dataset.shape[::-1])), np.dtype(dtype))] = dataset

    def _check(self, dataset: Any, variable: Variable) -> None:
        """Whether the file really holds the array."""
        if dataset.external or dataset.is_virtual:
            raise ValueError(f"'{variable.name[:60]}' lies in another file")
        stored = dataset.id.get_storage_size()
        chunk_bytes = int(np.prod(dataset.chunks, dtype=np.float64)) * dataset.dtype.itemsize if dataset.chunks else 0
        if max(dataset.nbytes, chunk_bytes) > _LARGEST_RATIO * stored:
            raise ValueError(
                f"'{variable.name[:60]}' promises {dataset.nbytes:,} bytes, the file holds {stored:,} of it"
            )
        if dataset.chunks:
            chunks = [-(-side // piece) for side, piece in zip(dataset.shape, dataset.chunks, strict=True)]
            if dataset.id.get_num_chunks() < int(np.prod(chunks, dtype=np.float64)):
                raise ValueError(f"parts of '{variable.name[:60]}' were never written")

    @contextmanager
    def _damage(self) -> Iterator[None]:
        """Whatever h5py raises at damaged files, as one line."""
        try:
            yield
        except SpectralBoothError:
            raise
        except Exception as error:  # OSError, KeyError, RuntimeError, ValueError, UnicodeError and more
            what = " ".join(str(error).split())[:160] or type(error).__name__
            raise TextureError(f"is a damaged MATLAB file ({what})", where=self._path, remedy="save it again") from None
