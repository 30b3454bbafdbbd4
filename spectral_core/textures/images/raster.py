"""Images of any format as OpenImageIO opens them: the stored numbers, nothing converted."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.errors import TextureError
from spectral_core.imaging import error_text, oiio
from spectral_core.textures.base import Samples, checked_size
from spectral_core.textures.images.tiff_layout import tiff_directories
from spectral_core.weights import LARGEST_BANDS

PICTURES = (b"\x89PNG", b"BM", b"\xff\xd8\xff")
TIFFS = (b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+")

_TYPES = {
    "uint8": np.uint8, "int8": np.int8, "uint16": np.uint16, "int16": np.int16, "uint32": np.uint32,
    "int32": np.int32, "int": np.int32, "uint": np.uint32, "half": np.float16, "float": np.float32,
    "double": np.float64,
}  # fmt: skip
_BLACK_IS_ZERO = (1, 2)  # grey, or RGB as a name for several samples
_MEANINGS = {0: "white is zero", 3: "a palette", 5: "inks", 6: "YCbCr", 8: "CIE Lab"}
# No row is larger than so many times its file: deflate comes to 1032, and others to more only with many rows.
_LARGEST_RATIO = 1 << 11
_ATTRIBUTES = threading.RLock()  # they are the library's, not a thread's


def open_image(path: Path) -> Any:
    """An OpenImageIO input that gives numbers as they are stored: no alpha multiplied in, no colours turned to RGB.

    Raises
    ------
    TextureError
        If it is no BMP, PNG, TIFF or JPEG, or damaged.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(8)
    except OSError as error:
        raise TextureError(f"cannot be read ({error.strerror})", where=path, remedy="check its permissions") from None
    # By content, as OpenImageIO does: it would try all its readers on it, whatever the name.
    if not head.startswith((*PICTURES, *TIFFS)):
        raise TextureError("is no BMP, PNG, TIFF or JPEG", where=path, remedy="write it again")
    if head.startswith(TIFFS):
        tiff_directories(path, 1)
    plain = oiio().ImageSpec()
    plain.attribute("oiio:UnassociatedAlpha", 1)
    plain.attribute("oiio:RawColor", 1)
    with library_attribute("limits:channels", LARGEST_BANDS):
        image = oiio().ImageInput.open(str(path), plain)
    if image is None:
        raise TextureError(f"is not an image ({error_text(oiio())})", where=path, remedy="write it again")
    return image


@contextmanager
def library_attribute(attribute: str, value: int) -> Iterator[None]:
    """An attribute of OpenImageIO for the calls in this block; other users of the library keep theirs."""
    with _ATTRIBUTES:
        before = oiio().get_int_attribute(attribute, 0)
        oiio().attribute(attribute, value)
        try:
            yield
        finally:
            oiio().attribute(attribute, before)


def stored_type(spec: Any, path: Path, is_mapped: bool = False) -> np.dtype[Any]:
    """Type of an image's samples, after its sides were found possible.

    Raises
    ------
    TextureError
        If its sides are impossible, far larger than the file, its samples are no numbers of intensity,
        or are such that OpenImageIO misreads them and they are not mapped without it.
    """
    checked_size(int(spec.width), int(spec.height), path)
    name = str(spec.format)
    if name not in _TYPES:
        raise TextureError(f"holds samples of type {name}", where=path, remedy="save integers or floating point")
    meaning = spec.get_int_attribute("tiff:PhotometricInterpretation", 1)
    if meaning not in _BLACK_IS_ZERO:
        raise TextureError(
            f"its samples are no intensities (photometric interpretation {_MEANINGS.get(meaning, meaning)})",
            where=path,
            remedy="save it with black as zero",
        )
    dtype = np.dtype(_TYPES[name])
    if dtype.itemsize == 8 and not is_mapped:
        # OpenImageIO up to 3.2.2 at least: tiles and parts of strips are not copied out of its buffer.
        raise TextureError(
            "holds 64-bit floating point in compressed strips or in tiles, which OpenImageIO misreads",
            where=path,
            remedy="save it as 32-bit floating point, or uncompressed in strips",
        )
    check_promise(spec, dtype.itemsize, path)
    return dtype


def check_promise(spec: Any, sample_bytes: int, path: Path) -> None:
    """Refuse an image whose smallest piece, a row or a row of tiles, is far larger than its file.

    Raises
    ------
    TextureError
        Before anything of it is allocated.
    """
    tile_width = max(1, int(spec.tile_width))
    width = -(-int(spec.width) // tile_width) * tile_width
    piece = width * max(1, int(spec.tile_height)) * int(spec.nchannels) * sample_bytes
    size = path.stat().st_size
    if piece > _LARGEST_RATIO * size:
        raise TextureError(
            f"promises {piece:,} bytes in its first rows, the file holds {size:,}",
            where=path,
            remedy="the file is damaged; write it again",
        )


def image_rows(image: Any, path: Path, subimage: int, first: int, count: int, channels: tuple[int, int]) -> Samples:
    """`count` rows from `first` on, channels from the first to before the second: (count, width, channels).

    Raises
    ------
    TextureError
        If they cannot be read.
    """
    spec = image.spec(subimage)
    pixels = (_tiled if spec.tile_height else _scanlines)(image, spec, subimage, first, count, channels)
    if pixels is None or image.has_error:  # a JPEG that is cut short is filled up with grey
        raise TextureError(
            f"rows from {first} on cannot be read ({error_text(image)})",
            where=path,
            remedy="the file is damaged, or packed as OpenImageIO cannot unpack; write it again",
        )
    return np.asarray(pixels).reshape(count, spec.width, channels[1] - channels[0])


def _scanlines(image: Any, spec: Any, subimage: int, first: int, count: int, channels: tuple[int, int]) -> Any:
    """Rows of an image that is stored in rows or strips."""
    begin = spec.y + first
    # OpenImageIO unpacks strips of deflate itself, and before 3.1 keeps to itself what fails; not so single rows.
    is_deflate = spec.get_string_attribute("compression") == "zip"
    step = 1 if is_deflate and spec.get_string_attribute("planarconfig") == "contig" else count
    blocks = [
        image.read_scanlines(subimage, 0, row, row + step, 0, *channels, spec.format)
        for row in range(begin, begin + count, step)
    ]
    if any(block is None for block in blocks):
        return None
    return blocks[0] if len(blocks) == 1 else np.concatenate(blocks)


def _tiled(image: Any, spec: Any, subimage: int, first: int, count: int, channels: tuple[int, int]) -> Any:
    """Rows of an image that is stored in tiles: whole rows of them are read, and what is more is dropped."""
    tile = int(spec.tile_height)
    begin, end = first // tile * tile, min(int(spec.height), -(-(first + count) // tile) * tile)
    pixels = image.read_tiles(
        subimage, 0, spec.x, spec.x + spec.width, spec.y + begin, spec.y + end, 0, 1, *channels, spec.format
    )
    if pixels is None:
        return None
    whole = np.asarray(pixels).reshape(end - begin, spec.width, -1)
    return whole[first - begin : first - begin + count]
