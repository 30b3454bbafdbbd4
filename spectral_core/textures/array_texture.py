"""A hyperspectral texture in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples, checked_wavelengths
from spectral_core.textures.reading import Reading, stated_kind


class ArrayTexture(HyperspectralTexture):
    """An array (height, width, bands) of any real type as a texture; it is not copied.

    Parameters
    ----------
    values
        (height, width, bands).
    wavelengths_nm
        (bands,).
    name
        For messages and file names.
    kind
        What the values are.
    scale
        Stored value of reflectance 1; integers need it.

    Raises
    ------
    TextureError
        If shape, type or wavelengths cannot be those of a texture.
    """

    format = "array"
    concurrent = True

    def __init__(
        self,
        values: Samples,
        wavelengths_nm: Float64Array,
        name: str = "array",
        kind: Kind = "reflectance",
        scale: float | None = None,
    ) -> None:
        values = np.asarray(values)
        if values.ndim != 3 or 0 in values.shape or values.dtype.kind not in "fiu":
            raise TextureError(
                f"an array of shape {values.shape} and type {values.dtype} is no texture",
                remedy="give real numbers of shape (height, width, bands)",
            )
        self._values = values
        self.name = name
        self.height, self.width, bands = values.shape
        self.wavelengths_nm = frozen(checked_wavelengths(np.asarray(wavelengths_nm, float), bands, Path(name)))
        self.kind, self.scale = stated_kind(Path(name), Reading(scale=scale), values.dtype, kind)

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: a view (count, width, bands)."""
        return self._values[first : first + count]
