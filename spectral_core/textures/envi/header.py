"""What an ENVI header says of its data file: size, type and order, and where each sample stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from spectral_core.errors import TextureError
from spectral_core.textures.base import LARGEST_SIDE, Samples
from spectral_core.textures.envi.text import EnviText, parse_text, read_text_of_header, shown

Interleave = Literal["bsq", "bil", "bip"]
_TYPES = {1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8"}
_COMPLEX_TYPES = {6: "complex64", 9: "complex128"}
_IMAGES = ("envi standard", "envi", "")
_LIBRARY = "envi spectral library"


@dataclass(frozen=True)
class EnviHeader:
    """Layout of the data file of an ENVI image or spectral library.

    Attributes
    ----------
    text
        The header's keys and values, with its path.
    samples, lines, bands
        Width, height and bands of an image; a library has one sample per wavelength, one line per
        spectrum and one band.
    dtype
        Of the samples, byte order included.
    interleave
        ``bsq`` (band by band), ``bil`` (band by band in each line) or ``bip`` (pixel by pixel).
    offset
        Bytes of the data file before its first sample.
    file_type
        As written, in lower case; empty if the header does not say it.
    warnings
        What was assumed.
    """

    text: EnviText
    samples: int
    lines: int
    bands: int
    dtype: np.dtype[Any]
    interleave: Interleave
    offset: int
    file_type: str
    warnings: tuple[str, ...]

    @property
    def path(self) -> Path:
        """Of the header, for messages."""
        return self.text.path

    @property
    def is_library(self) -> bool:
        """Whether the data are a spectral library, not an image."""
        return self.file_type == _LIBRARY

    def refuse_other_than_image(self) -> None:
        """Refuse what is no image of measured values.

        Raises
        ------
        TextureError
            For spectral libraries, classifications and all other types.
        """
        if self.is_library:
            raise TextureError(
                "is a spectral library, not an image",
                where=self.path,
                remedy="use it where tables of spectra are read, for example 'reflectance FILE'",
            )
        if self.file_type not in _IMAGES:
            raise TextureError(
                f"is of file type '{shown(self.file_type)}', not an image of measured values",
                where=self.path,
                remedy="give one of file type ENVI Standard",
            )

    def mapped(self, data: Path) -> Samples:
        """The data file as a memory map: a view (lines, samples, bands) in the file's own order.

        Raises
        ------
        TextureError
            If the file is shorter than the header promises, or cannot be mapped.
        """
        promised = self.offset + self.samples * self.lines * self.bands * self.dtype.itemsize
        try:
            available = data.stat().st_size
            if available < promised:
                raise TextureError(
                    f"holds {available:,} bytes, and {self.path.name} promises {promised:,} for {self.samples} samples"
                    f" x {self.lines} lines x {self.bands} bands of {self.dtype.name} after {self.offset:,} bytes",
                    where=data,
                    remedy="the file is cut short or the header is another's; copy both again",
                )
            stored = np.memmap(data, self.dtype, "r", self.offset, self._stored_shape())
        except (OSError, OverflowError) as error:
            raise TextureError(f"cannot be mapped ({error})", where=data, remedy="check its permissions") from None
        # A plain view: whatever numpy does with the subclass in every slice costs more than the slice.
        return np.asarray(stored).transpose(self._axes())

    def _stored_shape(self) -> tuple[int, int, int]:
        if self.interleave == "bsq":
            return self.bands, self.lines, self.samples
        if self.interleave == "bil":
            return self.lines, self.bands, self.samples
        return self.lines, self.samples, self.bands

    def _axes(self) -> tuple[int, int, int]:
        return {"bsq": (1, 2, 0), "bil": (0, 2, 1), "bip": (0, 1, 2)}[self.interleave]


def read_header(path: Path) -> EnviHeader:
    """Read an ENVI header, of an image or of a spectral library.

    Raises
    ------
    TextureError
        If it is none, lacks something, contradicts itself, or tells of data that cannot be read as they are.
    """
    return _header(read_text_of_header(path))


def parse_header(data: bytes, path: Path) -> EnviHeader:
    """The same of a header's bytes; `path` is for messages."""
    return _header(parse_text(data, path))


def _header(text: EnviText) -> EnviHeader:
    _refuse_what_cannot_be_mapped(text)
    samples, lines = (_side(text, key) for key in ("samples", "lines"))
    bands = _side(text, "bands")
    dtype, warnings = _dtype(text)
    offset = text.integer("header offset", 0)
    if offset < 0:
        raise TextureError(f"has a header offset of {offset}", where=text.path, remedy="give the bytes to skip")
    interleave = _interleave(text, bands)
    file_type = text.text("file type").casefold()
    said = (*text.warnings, *warnings)
    return EnviHeader(text, samples, lines, bands, dtype, interleave, offset, file_type, said)


def _side(text: EnviText, key: str) -> int:
    value = text.integer(key)
    if not 0 < value <= LARGEST_SIDE:
        raise TextureError(f"has {value} {key}", where=text.path, remedy="it is damaged or no texture")
    return value


def _refuse_what_cannot_be_mapped(text: EnviText) -> None:
    if text.integer("file compression", 0):
        raise TextureError("tells of a compressed data file", where=text.path, remedy="write it without compression")
    for key in ("major frame offsets", "minor frame offsets"):
        frames = text.numbers(key, 2, "ends of a frame")
        if frames is not None and frames.any():
            raise TextureError(f"has {key}, which are not read", where=text.path, remedy="write it without them")


def _interleave(text: EnviText, bands: int) -> Interleave:
    value = text.text("interleave").casefold()
    if not value and bands == 1:
        return "bsq"
    for each in get_args(Interleave):
        if value == each:
            return each  # type: ignore[no-any-return]
    raise TextureError(
        f"has the interleave '{shown(value)}'" if value else "lacks 'interleave'",
        where=text.path,
        remedy="give bsq, bil or bip",
    )


def _dtype(text: EnviText) -> tuple[np.dtype[Any], list[str]]:
    code = text.integer("data type")
    if code in _COMPLEX_TYPES:
        raise TextureError(
            f"holds complex numbers (data type {code}, {_COMPLEX_TYPES[code]})",
            where=text.path,
            remedy="write their real part or magnitude",
        )
    if code not in _TYPES:
        raise TextureError(
            f"has the data type {code}", where=text.path, remedy=f"give one of {', '.join(map(str, _TYPES))}"
        )
    if _TYPES[code] == "u1":
        return np.dtype("u1"), []
    order = text.integer("byte order", -1)
    if order in (0, 1):
        return np.dtype("<>"[order] + _TYPES[code]), []
    if text.text("byte order"):
        raise TextureError(
            f"has the byte order {order}", where=text.path, remedy="give 0 (little end first) or 1 (big end first)"
        )
    return np.dtype("<" + _TYPES[code]), ["the header does not say the byte order; little end first is assumed"]
