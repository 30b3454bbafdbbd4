"""MATLAB files of version 5 to 7: where their numeric arrays lie (MathWorks, MAT-File Format, R2024a).

scipy.io reads such files too, but believes them: 216 bytes that promise a struct array of 2**28 elements
cost it 4 GB and half a minute. Here headers alone are walked, nothing is made of what they promise, and
only plain numbers are read: uncompressed arrays are memory-mapped, compressed ones inflated. Cells,
objects and functions are skipped unread; there is nothing in the format that could be executed.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import TextureError
from spectral_core.textures.base import Samples
from spectral_core.textures.matlab.file import Variable
from spectral_core.textures.matlab.stream import DamagedError, ElementStream

_HEADER_BYTES = 128
# Data types of elements.
_TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_MATRIX, _COMPRESSED = 14, 15
# Of flags, dimensions and names; the second of a pair is what other programs write.
_FLAGS, _DIMENSIONS, _NAMES = (6,), (5, 6), (1, 16)
# Classes of arrays.
_CLASSES = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_STRUCT = 2
_COMPLEX, _LOGICAL = 0x08, 0x02
_MOST_ARRAYS = 10_000
_DEEPEST = 16
_MOST_DIMENSIONS = 32
_LONGEST_NAMES = 1 << 16


@dataclass(frozen=True)
class _Place:
    """Where the numbers of an array are: in the element of the file that begins at `start` and is `size` long,
    inflated if it is compressed, from `offset` on; or `inline`.
    """

    start: int
    size: int
    compressed: bool
    offset: int
    dtype: np.dtype[Any]
    inline: bytes | None


class Mat5File:
    """The numeric arrays of a file, also those in structs.

    Raises
    ------
    TextureError
        If it is damaged or cut short.
    """

    format = "MATLAB v5"

    def __init__(self, path: Path) -> None:
        self._path = path
        self._places: dict[Variable, _Place] = {}
        try:
            with path.open("rb") as stream:
                self._order = _byte_order(stream.read(_HEADER_BYTES))
                for start, size, compressed in _elements(stream, self._order, path.stat().st_size):
                    source = ElementStream(stream, start, size, compressed)
                    walk = _Walk(source, self._order, self._places)
                    walk.array("", 0)
        except (DamagedError, zlib.error, struct.error, OSError) as error:
            raise self._damaged(error) from None
        self.variables = tuple(self._places)

    def rows(self, cube: Variable) -> tuple[Callable[[int, int], Samples], bool]:
        """Views of the array, which is mapped or inflated as a whole: it lies column by column."""
        values = self._array(cube)
        return lambda first, count: values[first : first + count], True

    def vector(self, variable: Variable) -> Float64Array:
        """All numbers of an array, in MATLAB's order."""
        return np.asarray(self._array(variable).ravel(order="F"), dtype=np.float64)

    def _array(self, variable: Variable) -> Samples:
        place = self._places[variable]
        if place.inline is not None:
            return np.frombuffer(place.inline, place.dtype).reshape(variable.shape, order="F")
        if not place.compressed:
            return np.memmap(self._path, place.dtype, "r", place.offset, variable.shape, order="F")
        try:
            with self._path.open("rb") as stream:
                source = ElementStream(stream, place.start, place.size, compressed=True)
                source.skip_to(place.offset)
                values = source.numbers(math.prod(variable.shape), place.dtype)
                source.finish()
        except (DamagedError, zlib.error, OSError, MemoryError) as error:
            raise self._damaged(error) from None
        return values.reshape(variable.shape, order="F")

    def _damaged(self, error: Exception) -> TextureError:
        return TextureError(
            f"is a damaged MATLAB file ({str(error)[:120] or type(error).__name__})",
            where=self._path,
            remedy="save it again",
        )


def _byte_order(header: bytes) -> str:
    order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
    if order is None:
        raise DamagedError("its header does not say its byte order")
    return order


def _elements(stream: IO[bytes], order: str, file_size: int) -> Iterator[tuple[int, int, bool]]:
    """(start, size, compressed) of each variable's element: without its tag if compressed, else with it."""
    at = _HEADER_BYTES
    while at + 8 <= file_size:
        stream.seek(at)
        kind, size = struct.unpack(f"{order}II", stream.read(8))
        if kind not in (_MATRIX, _COMPRESSED):
            raise DamagedError(f"an element of type {kind} at byte {at}")
        if at + 8 + size > file_size:
            raise DamagedError(f"the element at byte {at} ends beyond the file: it is cut short")
        if kind == _COMPRESSED:
            yield at + 8, size, True
        else:
            yield at, size + 8, False
        at += 8 + size


@dataclass
class _Walk:
    """Goes through the headers of one variable and notes its numeric arrays in `places`."""

    source: ElementStream
    order: str
    places: dict[Variable, _Place]

    def array(self, name: str, depth: int) -> None:
        """An array element, all of it: `name` is that of the struct's field, empty for a variable."""
        kind, size, inline = self._tag()
        if kind != _MATRIX or inline is not None:
            raise DamagedError(f"an element of type {kind} instead of an array")
        end = self.source.at + size
        if end > self.source.end or depth > _DEEPEST:
            raise DamagedError("an array longer than its element")
        if size:
            self._content(name, end, depth)
        if depth:  # what follows a variable is another one
            self.source.skip_to(end)

    def _content(self, name: str, end: int, depth: int) -> None:
        flags, _ = struct.unpack(f"{self.order}II", self._data(_FLAGS, 8, exactly=True))
        array_class, flags = flags & 0xFF, flags >> 8
        if array_class not in _CLASSES and array_class != _STRUCT:
            return
        dimensions = self._data(_DIMENSIONS, 4 * _MOST_DIMENSIONS)
        shape = struct.unpack(f"{self.order}{len(dimensions) // 4}i", dimensions)
        if len(shape) < 2 or min(shape) < 0:
            raise DamagedError(f"an array of shape {shape}")
        own_name = self._data(_NAMES, _LONGEST_NAMES).decode("ascii", "replace")
        name = name or own_name
        if not name:  # what functions and objects of the file refer to
            return
        if array_class == _STRUCT:
            self._fields(name, shape, end, depth)
        elif not flags & (_COMPLEX | _LOGICAL) and self.source.at < end:
            self._numbers(Variable(name, shape, np.dtype(_CLASSES[array_class])))

    def _fields(self, name: str, shape: tuple[int, ...], end: int, depth: int) -> None:
        """The arrays of a struct's fields, element after element."""
        (length,) = struct.unpack(f"{self.order}i", self._data(_DIMENSIONS, 4, exactly=True))
        names = self._data(_NAMES, _LONGEST_NAMES)
        if length < 1:
            raise DamagedError(f"names of {length} characters")
        fields = [
            names[at : at + length].split(b"\0")[0].decode("ascii", "replace") for at in range(0, len(names), length)
        ]
        number = 0
        while self.source.at < end and fields:
            number += 1
            here = name if math.prod(shape) == 1 else f"{name}({number})"
            for each in fields:
                self.array(f"{here}.{each}", depth + 1)

    def _numbers(self, variable: Variable) -> None:
        kind, size, inline = self._tag()
        if kind not in _TYPES:
            raise DamagedError(f"numbers of type {kind}")
        dtype = np.dtype(self.order + _TYPES[kind])
        if size != math.prod(variable.shape) * dtype.itemsize:
            raise DamagedError(f"'{variable.name[:40]}' of shape {variable.shape} in {size:,} bytes")
        source = self.source
        if source.at + (0 if inline else size) > source.end:
            raise DamagedError(f"{size:,} bytes promised where there cannot be so many")
        if len(self.places) >= _MOST_ARRAYS:
            raise DamagedError(f"more than {_MOST_ARRAYS} arrays")
        self.places[variable] = _Place(source.start, source.size, source.compressed, source.at, dtype, inline)

    def _tag(self) -> tuple[int, int, bytes | None]:
        """Type and size of the next element, and its data if they fit into the tag."""
        raw = self.source.read(8)
        kind, size = struct.unpack(f"{self.order}II", raw)
        if kind >> 16 == 0:
            return kind, size, None
        if kind >> 16 > 4:
            raise DamagedError("a small element of more than four bytes")
        return kind & 0xFFFF, kind >> 16, raw[4 : 4 + (kind >> 16)]

    def _data(self, kinds: tuple[int, ...], most: int, exactly: bool = False) -> bytes:
        """The data of the next element, which must be of one of these types and `most` bytes long at most."""
        found, size, inline = self._tag()
        if found not in kinds or size > most or (exactly and size != most):
            raise DamagedError(f"an element of type {found} and {size:,} bytes in a header")
        # Elements begin at multiples of eight.
        return inline if inline is not None else self.source.read(size + -size % 8)[:size]
