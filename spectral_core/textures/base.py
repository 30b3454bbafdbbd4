"""What every hyperspectral texture is, whatever its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from spectral_core.arrays import BoolArray, Float32Array, Float64Array
from spectral_core.errors import TextureError

Kind = Literal["reflectance", "radiance", "counts", "unstated"]
KINDS: tuple[Kind, ...] = get_args(Kind)
# As stored: any real type, any strides, perhaps a view of a mapped file.
Samples = npt.NDArray[Any]

# A tile of float32 fills about half of a 2 MB second-level cache.
_TILE_BYTES = 1024 * 1024
# What a file may promise before anything of it is believed: sides of an image, and of its product.
LARGEST_SIDE = 1 << 24
LARGEST_PIXELS = 1 << 40


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
        (bands,), in the file's order: any order, distinct.
    kind
        ``reflectance`` (0..1), ``radiance`` (relative power), ``counts`` (of a camera), or
        ``unstated`` where the file does not say and nobody has said it.
    scale
        Stored value that stands for 1.
    good
        (bands,), False for bands that the file says are bad: they have no weight.
    ignore_value
        Stored value that stands for no data, None if there is none.
    fluorescent
        True if it was measured as fluorescent and reduced to its reflectance: another lamp would
        excite it otherwise.
    concurrent
        Whether `samples` may be called by several threads at once and in any order; else by one, and
        it is fast from the top down.
    files
        The files that it is read from, so that others can open it again and see whether it changed;
        none for what is computed or in memory.
    part
        What of its files it is, where they could hold several: the name of an array.
    warnings
        What a user should know of it.
    """

    name: str
    format: str
    height: int
    width: int
    wavelengths_nm: Float64Array
    kind: Kind
    scale: float = 1.0
    ignore_value: float | None = None
    fluorescent: bool = False
    concurrent: bool = False
    files: tuple[Path, ...] = ()
    part: str = ""
    warnings: tuple[str, ...] = ()

    @abstractmethod
    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on as they are stored: (count, width, bands), any real type.

        In the file's own order of axes: a view with its strides, not a copy, where that is
        possible. What `values` are is ``(samples - dark) * gain``.
        """

    def close(self) -> None:  # noqa: B027  # most hold nothing open
        """Let go of what is open for reading; the next read opens it again."""

    @property
    def gain(self) -> Float64Array:
        """(bands,) or (width, bands): value per stored unit."""
        return np.full(self.bands, 1.0 / self.scale)

    @property
    def dark(self) -> Float64Array:
        """(bands,) or (width, bands): stored value that stands for 0."""
        return np.zeros(self.bands)

    @property
    def good(self) -> BoolArray:
        """(bands,): which bands can be used."""
        return np.ones(self.bands, dtype=bool)

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

    def rows(self, first: int, count: int) -> Float32Array:
        """`count` rows from `first` on: (count, width, bands), float32, no data as NaN.

        What float32 cannot hold becomes infinite, which whoever uses the pixels counts.
        """
        stored = self.samples(first, count)
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.array(stored, dtype=np.float32, order="C")
            dark = self.dark
            if dark.any():
                values -= dark.astype(np.float32)
            if (self.gain != 1).any():
                values *= self.gain.astype(np.float32)
        if self.ignore_value is not None:
            values[stored == self.ignore_value] = np.nan
        return values

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


def checked_size(width: int, height: int, path: Path) -> None:
    """Refuse sides that no image has.

    Raises
    ------
    TextureError
        If a side is not positive, or far too large.
    """
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE and width * height <= LARGEST_PIXELS):
        raise TextureError(f"is {width} x {height} pixels", where=path, remedy="it is damaged or no texture")
