"""Rows of files that can only be read in larger pieces than a tile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spectral_core.textures.base import Samples

# What is unpacked at a time: large against what a call costs, small against a computer's memory.
BLOCK_BYTES = 32 * 1024 * 1024


class RowBuffer:
    """Keeps the block of rows that was read last.

    Parameters
    ----------
    read
        (first, count) to rows (count, width, bands), in any strides.
    height
        Rows there are.
    block
        Rows of a block; all begin at its multiples.
    """

    def __init__(self, read: Callable[[int, int], Samples], height: int, block: int) -> None:
        self._read = read
        self._height = height
        self._size = max(1, min(block, height))
        self._start = -1
        self._block: Samples = np.empty(0)

    def rows(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on; a view unless they lie in two blocks."""
        parts = []
        for start in range(first // self._size * self._size, first + count, self._size):
            if start != self._start:
                # The old block goes first: two at a time would be twice the memory.
                self._start, self._block = -1, np.empty(0)
                self._block = self._read(start, min(self._size, self._height - start))
                self._start = start
            parts.append(self._block[max(0, first - start) : first + count - start])
        return parts[0] if len(parts) == 1 else np.concatenate(parts)


def block_rows(row_bytes: int, unit: int, largest_bytes: int = BLOCK_BYTES) -> int:
    """Rows of a block of about `largest_bytes`: a multiple of the file's own `unit`, at least one of it."""
    return max(1, largest_bytes // (row_bytes * unit)) * unit
