"""The bytes of one element of a MATLAB file, inflated or not, never more than there can be."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np

from spectral_core.textures.base import Samples

# Deflate packs nothing more densely.
_LARGEST_RATIO = 1032
_PIECE = 1 << 18


class DamagedError(Exception):
    """What is not as the format says."""


@dataclass
class ElementStream:
    """The bytes of an element one after the other; positions are those of the file, or of what is inflated."""

    stream: IO[bytes]
    start: int
    size: int
    compressed: bool
    at: int = field(init=False)

    def __post_init__(self) -> None:
        self.stream.seek(self.start)
        self.at = 0 if self.compressed else self.start
        # No more can be promised than can be inflated.
        self.end = self.at + self.size * (_LARGEST_RATIO if self.compressed else 1)
        self._inflate = zlib.decompressobj()
        self._packed = self.size

    def read(self, count: int) -> bytes:
        """Exactly `count` bytes."""
        if self.at + count > self.end:
            raise DamagedError(f"{count:,} bytes promised where there cannot be so many")
        result = b"".join(self._pieces(count))
        if len(result) < count:
            raise DamagedError("the data ends early")
        return result

    def skip_to(self, position: int) -> None:
        """Go on at a later position."""
        if not self.at <= position <= self.end:
            raise DamagedError("an array longer than its element")
        if self.compressed:
            wanted = position - self.at
            if sum(len(piece) for piece in self._pieces(wanted)) < wanted:
                raise DamagedError("the data ends early")
        else:
            self.stream.seek(position)
            self.at = position

    def numbers(self, count: int, dtype: np.dtype[Any]) -> Samples:
        """`count` numbers; only what the file really holds is ever written to."""
        size = count * dtype.itemsize
        if self.at + size > self.end:
            raise DamagedError(f"{size:,} bytes promised where there cannot be so many")
        result = np.empty(size, np.uint8)
        filled = 0
        for piece in self._pieces(size):
            result[filled : filled + len(piece)] = np.frombuffer(piece, np.uint8)
            filled += len(piece)
        if filled < size:
            raise DamagedError("the data ends early")
        return result.view(dtype)

    def finish(self) -> None:
        """Inflate what is left, at whose end the checksum is compared."""
        for _ in self._pieces(self.end - self.at):
            pass
        if not self._inflate.eof:
            raise DamagedError("the compressed data ends early")

    def _pieces(self, count: int) -> Iterator[bytes]:
        """At most `count` bytes in pieces, fewer at the end."""
        while count > 0:
            piece = self._inflated(min(count, _PIECE)) if self.compressed else self.stream.read(min(count, _PIECE))
            if not piece:
                return
            self.at += len(piece)
            count -= len(piece)
            yield piece

    def _inflated(self, most: int) -> bytes:
        while not self._inflate.eof:
            packed = self._inflate.unconsumed_tail
            if not packed:
                packed = self.stream.read(min(_PIECE, self._packed))
                self._packed -= len(packed)
            piece = self._inflate.decompress(packed, most)
            if piece or not packed:
                return piece
        return b""
