"""Where the samples of a TIFF lie in its file (TIFF 6.0; BigTIFF of libtiff).

OpenImageIO says everything of a TIFF but that. It serves two ends: images that a memory map can show,
and strips that lie beyond the end of a damaged file, which some versions of OpenImageIO crash at.
"""

from __future__ import annotations

import math
import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from spectral_core.errors import TextureError
from spectral_core.textures.base import Samples

_WIDTH, _LENGTH, _BITS, _COMPRESSION, _FILL_ORDER, _SAMPLES, _STRIP_ROWS = 256, 257, 258, 259, 266, 277, 278
_STRIPS, _STRIP_BYTES, _PLANAR, _TILE_WIDTH, _TILE_LENGTH, _TILES, _TILE_BYTES = 273, 279, 284, 322, 323, 324, 325
_FORMAT = 339
_WANTED = {
    _WIDTH, _LENGTH, _BITS, _COMPRESSION, _FILL_ORDER, _SAMPLES, _STRIP_ROWS, _STRIPS, _STRIP_BYTES, _PLANAR,
    _TILE_WIDTH, _TILE_LENGTH, _TILES, _TILE_BYTES, _FORMAT,
}  # fmt: skip
# BYTE, SHORT, LONG, LONG8: all that a number of these tags may be stored as.
_INTEGERS = {1: "u1", 3: "u2", 4: "u4", 16: "u8"}
_KINDS = {1: "u", 2: "i", 3: "f"}
_MOST_ENTRIES = 4096
# Numbers in the entries of all pages: 4000 bands of 4000 rows, each a strip of its own.
_MOST_NUMBERS = 1 << 24

Tags = dict[int, npt.NDArray[np.unsignedinteger[Any]]]


@dataclass(frozen=True)
class TiffLayout:
    """Images of equal size, uncompressed and each in one piece.

    Attributes
    ----------
    dtype
        With the file's byte order.
    starts
        Byte at which each image begins.
    shape
        (height, width, samples side by side) of each.
    """

    dtype: np.dtype[Any]
    starts: tuple[int, ...]
    shape: tuple[int, int, int]


def tiff_directories(path: Path, pages: int) -> tuple[str, list[Tags]]:
    """Byte order and the tags that tell of the layout, of the first `pages` pages.

    Raises
    ------
    TextureError
        If they are damaged, or strips or tiles are missing or lie beyond the end of the file.
    """
    try:
        with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            order = {b"II": "<", b"MM": ">"}[data[:2]]
            found = _directories(data, order, pages)
            for tags in found:
                _check_pieces(tags, len(data))
    except (KeyError, IndexError, struct.error, ValueError, OverflowError) as error:
        raise TextureError(
            f"has a damaged TIFF directory ({str(error)[:80]})", where=path, remedy="write it again"
        ) from None
    return order, found


def tiff_layout(order: str, pages: list[Tags]) -> TiffLayout | None:
    """The layout of pages in one piece each, None if they cannot be mapped."""
    layouts = [_layout(order, tags) for tags in pages]
    first = layouts[0]
    if first is None or any(each is None or (each.dtype, each.shape) != (first.dtype, first.shape) for each in layouts):
        return None
    return TiffLayout(first.dtype, tuple(start for each in layouts if each for start in each.starts), first.shape)


def mapped(path: Path, layout: TiffLayout) -> list[Samples]:
    """Views of the file: one (height, width, bands), or one for each image if they lie at uneven distances."""
    data = np.memmap(path, dtype=np.uint8, mode="r")
    height, width, samples = layout.shape
    size = layout.dtype.itemsize
    strides = (width * samples * size, samples * size, size)
    steps = set(np.diff(layout.starts).tolist())
    if samples == 1 and len(steps) == 1 and min(steps) > 0:
        shape = (height, width, len(layout.starts))
        return [np.ndarray(shape, layout.dtype, data, layout.starts[0], (*strides[:2], steps.pop()))]
    return [np.ndarray(layout.shape, layout.dtype, data, start, strides) for start in layout.starts]


def _directories(data: mmap.mmap, order: str, pages: int) -> list[Tags]:
    big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
    at = struct.unpack_from(f"{order}Q", data, 8)[0] if big else struct.unpack_from(f"{order}I", data, 4)[0]
    found, numbers = [], 0
    for _ in range(pages):
        tags, at = _directory(data, at, order, big)
        numbers += sum(map(len, tags.values()))
        if numbers > _MOST_NUMBERS:
            raise ValueError("too many strips")
        found.append(tags)
    return found


def _directory(data: mmap.mmap, at: int, order: str, big: bool) -> tuple[Tags, int]:
    """Wanted tags of the directory at a byte, and where the next one is."""
    head, entry, pointer = ("Q", "HHQQ", "Q") if big else ("H", "HHII", "I")
    (count,) = struct.unpack_from(order + head, data, at)
    if not 0 < count <= _MOST_ENTRIES:
        raise ValueError(f"{count} entries")
    at += struct.calcsize(order + head)
    inline = struct.calcsize(order + pointer)
    tags: Tags = {}
    for _ in range(count):
        tag, kind, number, place = struct.unpack_from(order + entry, data, at)
        at += struct.calcsize(order + entry)
        if tag in _WANTED:
            dtype = np.dtype(order + _INTEGERS[kind])
            if not 0 < number <= _MOST_NUMBERS:
                raise ValueError(f"{number} numbers in entry {tag}")
            # Few numbers stand in the entry itself, where the place of many would.
            start = at - inline if number * dtype.itemsize <= inline else place
            tags[tag] = np.frombuffer(data[start : start + number * dtype.itemsize], dtype, number)
    return tags, struct.unpack_from(order + pointer, data, at)[0]


def _number(tags: Tags, tag: int, default: int) -> int:
    return int(tags[tag][0]) if tag in tags else default


def _check_pieces(tags: Tags, file_size: int) -> None:
    """As many strips or tiles as the image needs, none of them empty or beyond the end of the file."""
    width, height = int(tags[_WIDTH][0]), int(tags[_LENGTH][0])
    if _TILES in tags:
        offsets, counts = tags[_TILES], tags[_TILE_BYTES]
        pieces = math.ceil(width / int(tags[_TILE_WIDTH][0])) * math.ceil(height / int(tags[_TILE_LENGTH][0]))
    else:
        offsets, counts = tags[_STRIPS], tags[_STRIP_BYTES]
        pieces = math.ceil(height / max(1, min(height, _number(tags, _STRIP_ROWS, height))))
    needed = pieces * (_number(tags, _SAMPLES, 1) if _number(tags, _PLANAR, 1) == 2 else 1)
    if not len(offsets) == len(counts) >= needed:
        raise ValueError(f"{len(offsets)} strips or tiles, {needed} needed")
    # As floating point the sum of two 64-bit numbers cannot overflow.
    if counts.min() == 0 or (offsets.astype(np.float64) + counts.astype(np.float64)).max() > file_size:
        raise ValueError("strips or tiles beyond the end of the file: it is cut short")


def _layout(order: str, tags: Tags) -> TiffLayout | None:
    """The layout of one page, None if it is compressed, in tiles, or in strips here and there."""
    plain = _number(tags, _COMPRESSION, 1) == 1 == _number(tags, _FILL_ORDER, 1)
    if not plain or _TILES in tags:
        return None
    dtype = _dtype(order, tags)
    samples, planar = _number(tags, _SAMPLES, 1), _number(tags, _PLANAR, 1)
    images = samples if planar == 2 else 1
    offsets, counts = tags[_STRIPS].astype(np.int64), tags[_STRIP_BYTES].astype(np.int64)
    if dtype is None or samples < 1 or planar not in (1, 2) or len(offsets) % images:
        return None
    shape = (int(tags[_LENGTH][0]), int(tags[_WIDTH][0]), samples // images)
    offsets, counts = offsets.reshape(images, -1), counts.reshape(images, -1)
    ends = offsets + counts
    in_one_piece = (offsets[:, 1:] == ends[:, :-1]).all()
    if not in_one_piece or (counts.sum(axis=1) != math.prod(shape) * dtype.itemsize).any():
        return None
    return TiffLayout(dtype, tuple(offsets[:, 0].tolist()), shape)


def _dtype(order: str, tags: Tags) -> np.dtype[Any] | None:
    """The type that all samples share, None if they do not or numpy has no such type."""
    bits = set(tags[_BITS].tolist()) if _BITS in tags else {1}
    formats = set(tags[_FORMAT].tolist()) if _FORMAT in tags else {1}
    if len(bits) != 1 or len(formats) != 1 or not bits <= {8, 16, 32, 64} or not formats <= _KINDS.keys():
        return None
    kind = _KINDS[formats.pop()] + str(bits.pop() // 8)
    return None if kind == "f1" else np.dtype(order + kind)
