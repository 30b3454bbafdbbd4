"""What every hyperspectral texture is, whatever its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from spectral_core.arrays import Float32Array, Float64Array
from spectral_core.errors import TextureError

Kind = Literal["reflectance", "radiance"]

# Rows per tile are chosen so that a tile of float32 fills about half of a 2 MB second-level cache.
_TILE_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Tile:
    """Whole rows of a texture.

    Attributes
    ----------
    first_row
        From 0 at the top.
    values
        (rows, width, bands), float32.
    """

    first_row: int
    values: Float32Array


class HyperspectralTexture(ABC):
    """A texture with one spectrum per pixel, read in tiles and never as a whole.

    Attributes
    ----------
    name, format
        For tables and messages.
    height, width
        In pixels; rows run from the top.
    wavelengths_nm
        (bands,), in the file's order.
    kind
        ``reflectance`` (0..1) or ``radiance`` (relative power).
    warnings
        What a user should know of it.
    """

    name: str
    format: str
    height: int
    width: int
    wavelengths_nm: Float64Array
    kind: Kind
    scale: float
    warnings: tuple[str, ...]

    @abstractmethod
    def rows(self, first: int, count: int) -> Float32Array:
        """`count` rows from `first` on: (count, width, bands), float32."""

    @property
    def bands(self) -> int:
        """Number of bands."""
        return len(self.wavelengths_nm)

    @property
    def step_nm(self) -> float:
        """Median distance of neighbouring bands, 0 for a single band."""
        return float(np.median(np.abs(np.diff(np.sort(self.wavelengths_nm))))) if self.bands > 1 else 0.0

    def rows_per_tile(self) -> int:
        """Rows that fill a tile, at least one."""
        return max(1, min(self.height, _TILE_BYTES // (self.width * self.bands * 4)))

    def tiles(self) -> Iterator[Tile]:
        """All rows from the top, a tile at a time."""
        step = self.rows_per_tile()
        for first in range(0, self.height, step):
            yield Tile(first, self.rows(first, min(step, self.height - first)))

    def pixel(self, x: int, y: int) -> Float64Array:
        """Spectrum (bands,) at column x (to the right) and row y (down), both from 0."""
        return np.asarray(self.rows(y, 1)[0, x], dtype=np.float64)


def checked_wavelengths(wavelengths: Float64Array, bands: int, path: Path) -> Float64Array:
    """The wavelengths (bands,) of a texture in nm, as they are.

    Raises
    ------
    TextureError
        If they are not one for each band, no nanometres of light, or repeated.
    """
    if wavelengths.shape != (bands,):
        raise TextureError(
            f"{wavelengths.size} wavelengths for {bands} bands", where=path, remedy="give one wavelength per band"
        )
    if not np.isfinite(wavelengths).all() or wavelengths.min() < 100 or wavelengths.max() > 5000:
        raise TextureError("the wavelengths are not nanometres of light", where=path, remedy="give them in nm")
    if len(np.unique(wavelengths)) < bands:
        raise TextureError("a wavelength occurs twice", where=path, remedy="average or drop one of the two bands")
    return wavelengths
