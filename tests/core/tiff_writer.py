"""A writer of TIFFs as others write them: any type, byte order, arrangement and directory."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np

_CODES = {"u": 1, "i": 2, "f": 3}


def tiff_bytes(
    pages: Sequence[np.ndarray],
    order: str = "<",
    big: bool = False,
    planar: bool = False,
    strip_rows: int | None = None,
    packed: bool = False,
    description: str = "",
    photometric: int = 1,
    gaps: Sequence[int] = (0,),
) -> bytes:
    """Pages (height, width, samples), each after `gaps` bytes of nothing, in turn."""
    data = bytearray((b"II" if order == "<" else b"MM") + struct.pack(f"{order}HHHQ", 43, 8, 0, 0))
    pointer = 8
    if not big:
        data, pointer = bytearray(data[:2] + struct.pack(f"{order}HI", 42, 0)), 4
    for number, page in enumerate(pages):
        data += b"\0" * gaps[number % len(gaps)]
        offsets, counts = _write_strips(data, page, order, planar, strip_rows, packed)
        tags = _tags(page, planar, strip_rows, packed, photometric)
        tags |= {273: ("Q" if big else "I", offsets), 279: ("Q" if big else "I", counts)}
        if description:
            tags[270] = ("s", description.encode() + b"\0")
        data += b"\0" * (-len(data) % 8)
        struct.pack_into(order + ("Q" if big else "I"), data, pointer, len(data))
        pointer = _write_directory(data, tags, order, big)
    return bytes(data)


def _write_strips(
    data: bytearray, page: np.ndarray, order: str, planar: bool, strip_rows: int | None, packed: bool
) -> tuple[list[int], list[int]]:
    offsets, counts = [], []
    for image in np.moveaxis(page, -1, 0) if planar else [page]:
        for first in range(0, len(image), strip_rows or len(image)):
            strip = np.ascontiguousarray(image[first : first + (strip_rows or len(image))])
            stored = strip.astype(strip.dtype.newbyteorder(order)).tobytes()
            stored = zlib.compress(stored) if packed else stored
            offsets.append(len(data))
            counts.append(len(stored))
            data += stored
    return offsets, counts


def _tags(
    page: np.ndarray, planar: bool, strip_rows: int | None, packed: bool, photometric: int
) -> dict[int, tuple[str, object]]:
    height, width, samples = page.shape
    return {
        256: ("I", [width]),
        257: ("I", [height]),
        258: ("H", [page.dtype.itemsize * 8] * samples),
        259: ("H", [8 if packed else 1]),
        262: ("H", [photometric]),
        277: ("H", [samples]),
        278: ("I", [strip_rows or height]),
        284: ("H", [2 if planar else 1]),
        339: ("H", [_CODES[page.dtype.kind]] * samples),
    }


def _write_directory(data: bytearray, tags: dict[int, tuple[str, object]], order: str, big: bool) -> int:
    """Where the pointer to the next directory is."""
    kinds = {"s": 2, "H": 3, "I": 4, "Q": 16}
    inline, at = (8, len(data)) if big else (4, len(data))
    entry = 20 if big else 12
    data += struct.pack(order + ("Q" if big else "H"), len(tags))
    start = len(data)
    data += b"\0" * (entry * len(tags) + inline)
    for number, tag in enumerate(sorted(tags)):
        kind, values = tags[tag]
        stored = values if kind == "s" else struct.pack(f"{order}{len(values)}{kind}", *values)
        place = stored.ljust(inline, b"\0")
        if len(stored) > inline:
            place = struct.pack(order + ("Q" if big else "I"), len(data))
            data += stored + b"\0" * (-len(stored) % 8)
        head = struct.pack(order + ("HHQ" if big else "HHI"), tag, kinds[kind], len(values))
        data[start + entry * number : start + entry * (number + 1)] = head + place
    assert at % 8 == 0
    return start + entry * len(tags)
