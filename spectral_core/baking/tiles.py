"""Rows as they are stored, cut into tiles that a cache holds, and made ready for a product of matrices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spectral_core.arrays import Float32Array
from spectral_core.baking.products import is_ready
from spectral_core.textures.base import Samples

# A tile in float32. The last cache holds it, and threads seldom wait for the interpreter; with tiles of 1 MB,
# which a second-level cache holds, integers take a fifth longer (``benchmarks/projection.py``).
TILE_BYTES = 4 * 1024 * 1024


def tiles(stored: Samples, size: int) -> Iterator[tuple[int, Samples]]:
    """(first pixel, tile (rows, columns, bands)) of rows (height, width, bands): views of about `size` pixels.

    Whole rows where they are shorter than a tile.
    """
    height, width, _ = stored.shape
    if is_ready(stored[0]) and as_it_lies(stored) is None:
        size = min(size, width)  # rows that do not follow each other are multiplied one at a time
    rows, columns = max(1, size // width), min(width, size)
    for row in range(0, height, rows):
        for column in range(0, width, columns):
            yield row * width + column, stored[row : row + rows, column : column + columns]


def as_it_lies(tile: Samples) -> Float32Array | None:
    """The tile as pixels (rows * columns, bands) if it can be multiplied without a copy, else None."""
    rows, columns, bands = tile.shape
    if rows > 1 and tile.strides[0] != columns * tile.strides[1]:
        return None
    pixels = tile[0] if rows == 1 else tile.reshape(rows * columns, bands)
    return pixels if is_ready(pixels) else None


def as_float32(tile: Samples, scratch: Float32Array) -> Float32Array:
    """A copy of the tile in scratch memory: pixels (rows * columns, bands), bands first if they lie first."""
    rows, columns, bands = tile.shape
    flat = scratch[: tile.size]
    with np.errstate(over="ignore", invalid="ignore"):
        if abs(tile.strides[2]) <= abs(tile.strides[1]):
            np.copyto(flat.reshape(tile.shape), tile, casting="unsafe")
            return flat.reshape(rows * columns, bands)
        np.copyto(flat.reshape(bands, rows, columns).transpose(1, 2, 0), tile, casting="unsafe")
    return flat.reshape(bands, rows * columns).T
