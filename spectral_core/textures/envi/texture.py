"""ENVI images: a header of text and a memory-mapped file of samples, in any of its three orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Samples, checked_size, checked_wavelengths
from spectral_core.textures.envi.channels import (
    calibration,
    good_channels,
    ignore_value,
    order_warning,
    refuse_other_than_light,
    refuse_repeated,
    wavelengths_nm,
)
from spectral_core.textures.envi.files import header_and_data
from spectral_core.textures.envi.header import EnviHeader, read_header
from spectral_core.textures.reading import Reading, stated_kind, stated_wavelengths
from spectral_core.weights import LARGEST_BANDS


class EnviTexture(HyperspectralTexture):
    """An ENVI image as a texture; it is mapped, never read as a whole.

    Parameters
    ----------
    path
        Of the header or of the data file; the other one lies beside it.
    reading
        What the user says of it, before what the header says.

    Raises
    ------
    TextureError
        If a file is missing, damaged or no image of real numbers, or its wavelengths are not known.
    """

    format = "ENVI"
    concurrent = True

    def __init__(self, path: Path, reading: Reading) -> None:
        header_path, data = header_and_data(path)
        header = read_header(header_path)
        header.refuse_other_than_image()
        checked_size(header.samples, header.lines, header.path)
        if header.bands > LARGEST_BANDS:
            raise TextureError(
                f"has {header.bands} bands, more than {LARGEST_BANDS}",
                where=header.path,
                remedy="average neighbouring ones: 1 nm is plenty",
            )
        wavelengths, of_wavelengths = _wavelengths(header, reading)
        self.wavelengths_nm = frozen(wavelengths)
        self._good = good_channels(header)
        self.ignore_value, of_ignored = ignore_value(header)
        self._calibration = calibration(header, reading)
        # Calibrated values are no integers any more.
        dtype = header.dtype if self._calibration.gain is None else np.dtype(np.float64)
        self.kind, self.scale = stated_kind(data, reading, dtype, self._calibration.kind, self._calibration.scale)
        self._cube = header.mapped(data)
        self.files = (header.path, data)
        self.name = data.stem
        self.height, self.width = header.lines, header.samples
        self.warnings = (*header.warnings, *of_wavelengths, *of_ignored, *self._calibration.warnings)

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: a view (count, width, bands) of the map, in the file's byte order."""
        return self._cube[first : first + count]

    @property
    def gain(self) -> Float64Array:
        """(bands,): value per stored unit."""
        return super().gain if self._calibration.gain is None else self._calibration.gain

    @property
    def dark(self) -> Float64Array:
        """(bands,): stored value that stands for 0."""
        return super().dark if self._calibration.dark is None else self._calibration.dark

    @property
    def good(self) -> BoolArray:
        """(bands,): False for those that the header's bad-band list calls bad."""
        return self._good


def _wavelengths(header: EnviHeader, reading: Reading) -> tuple[Float64Array, list[str]]:
    """Wavelengths in nm: the user's, or else the header's."""
    given = stated_wavelengths(reading, header.bands, header.path)
    if given is not None:
        replaced = header.text.text("wavelength") != ""
        return given, ["the wavelengths that were given replace the header's"] if replaced else []
    values, warnings = wavelengths_nm(header)
    if values is None:
        raise TextureError(
            f"does not say the wavelengths of its {header.bands} bands",
            where=header.path,
            remedy="give them with --wavelengths first:last:step in nm",
        )
    refuse_other_than_light(values, header)
    refuse_repeated(values, np.ones(header.bands, dtype=bool), header)
    return checked_wavelengths(values, header.bands, header.path), [*warnings, *order_warning(values)]
