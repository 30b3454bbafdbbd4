"""RGB textures as they are stored: codes, row by row, through OpenImageIO."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from spectral_core.errors import TextureError
from spectral_core.files import is_file, why_no_file
from spectral_core.imaging import error_text, oiio
from spectral_core.textures.base import checked_size

# What an RGB texture may be; OpenImageIO would open videos and spreadsheets of pixels as well.
_FORMATS = ("png", "tiff", "jpeg", "bmp", "targa", "webp")
_REMEDY = "give an RGB image of 8 or 16 bits as PNG, TIFF or JPEG"
# Deflate, the densest of the formats that say their own size, packs at most so many bytes into one.
_DENSEST = 1100
# Larger than any texture: 64 K x 64 K.
_MOST_PIXELS = 1 << 32

Codes = npt.NDArray[np.unsignedinteger[Any]]


class RgbImage:
    """An RGB image of 8 or 16 bits, read a few rows at a time.

    Attributes
    ----------
    path, width, height
        Of the file.
    bits
        8 or 16 per channel.
    icc
        The ICC profile that it holds, empty if none.
    colour_space
        What it says its codes are, as OpenImageIO names it.
    warnings
        What of it is left out.

    Raises
    ------
    TextureError
        If it is missing, damaged or no such image.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path = Path(path)
        if not is_file(path):
            raise TextureError(why_no_file(path), where=path, remedy="name an RGB image")
        how = oiio().ImageSpec()
        # Colours, not colours times alpha.
        how.attribute("oiio:UnassociatedAlpha", 1)
        self._input: Any = oiio().ImageInput.open(str(path), how)
        if self._input is None:
            raise TextureError(f"is no image ({error_text(oiio())})", where=path, remedy=_REMEDY)
        spec = self._input.spec()
        kind = self._input.format_name()
        if kind not in _FORMATS:
            raise TextureError(f"is an image of type {kind}", where=path, remedy=_REMEDY)
        if str(spec.format) not in ("uint8", "uint16"):
            raise TextureError(f"holds samples of type {spec.format}", where=path, remedy=_REMEDY)
        if spec.depth > 1 or not 1 <= spec.nchannels <= 4:
            raise TextureError(f"has {spec.nchannels} channels and depth {spec.depth}", where=path, remedy=_REMEDY)
        self.width, self.height = int(spec.width), int(spec.height)
        checked_size(self.width, self.height, path)
        self._channels = int(spec.nchannels)
        self.bits = 8 if str(spec.format) == "uint8" else 16
        self._check_size(kind)
        self._tile_rows, self._left, self._top = int(spec.tile_height), int(spec.x), int(spec.y)
        self.icc = _icc(spec)
        self.colour_space = str(spec.get_string_attribute("oiio:ColorSpace"))
        self.warnings = tuple(_left_out(spec, kind))

    def rows(self, first: int, count: int) -> Codes:
        """Codes (count, width, 3) of rows from the top, uint8 or uint16."""
        low, high = self._top + first, self._top + first + count
        kind = f"uint{self.bits}"
        if self._tile_rows:
            begin = self._top + first // self._tile_rows * self._tile_rows
            end = min(self._top + self.height, self._top - (-(first + count) // self._tile_rows) * self._tile_rows)
            pixels = self._input.read_tiles(
                0, 0, self._left, self._left + self.width, begin, end, 0, 1, 0, self._channels, kind
            )
        else:
            begin, end = low, high
            pixels = self._input.read_scanlines(0, 0, low, high, 0, 0, self._channels, kind)
        if pixels is None:
            raise TextureError(
                f"row {first} cannot be read ({error_text(self._input)})", where=self.path, remedy="write it again"
            )
        found = np.asarray(pixels).reshape(end - begin, self.width, self._channels)[low - begin : high - begin]
        return found[..., :3] if self._channels >= 3 else np.repeat(found[..., :1], 3, axis=-1)

    def _check_size(self, kind: str) -> None:
        size = self.path.stat().st_size
        promised = self.width * self.height * self._channels * self.bits // 8
        if self.width * self.height > _MOST_PIXELS or (kind in ("png", "bmp", "targa") and promised > _DENSEST * size):
            raise TextureError(
                f"the header promises {self.width} x {self.height} pixels, the file holds {size:,} bytes",
                where=self.path,
                remedy="it is damaged or no texture",
            )


def _icc(spec: Any) -> bytes:
    found = spec.getattribute("ICCProfile")
    return b"" if found is None else np.asarray(found, dtype=np.uint8).tobytes()


def _left_out(spec: Any, kind: str) -> list[str]:
    warnings = []
    if spec.nchannels in (2, 4):
        warnings.append("its alpha channel is left out: hidden texels get a reflectance like any other")
    if spec.nchannels < 3:
        warnings.append("it is grey: its code is taken as red, green and blue")
    if int(spec.get_int_attribute("Orientation", 1)) != 1:
        warnings.append("it says that it is to be turned; it is read as stored")
    if kind == "jpeg":
        warnings.append("JPEG: its losses are in the colours that are matched")
    return warnings
