"""TIFF with many samples per pixel, or one page per band.

Uncompressed images in one piece are memory-mapped; anything else is read by rows through OpenImageIO.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.imaging import error_text
from spectral_core.textures.base import HyperspectralTexture, Samples, checked_wavelengths
from spectral_core.textures.images.raster import image_rows, library_attribute, open_image, stored_type
from spectral_core.textures.images.row_buffer import RowBuffer, block_rows
from spectral_core.textures.images.sequence import single_image
from spectral_core.textures.images.tiff_layout import mapped, tiff_directories, tiff_layout
from spectral_core.textures.reading import Reading, stated_kind, stated_wavelengths
from spectral_core.textures.wavelengths import ask_for_wavelengths, wavelengths_in_text
from spectral_core.weights import LARGEST_BANDS

# With fewer channels it is a picture, until someone says wavelengths.
_FEWEST_BANDS = 5
# What strips of all bands may unpack to at once.
_LARGEST_BLOCK = 4 << 30
_LOSSY = {"jpeg", "ojpeg", "jp2", "jpeg2000", "webp"}


class MultibandTiff(HyperspectralTexture):
    """A TIFF whose samples or pages are bands.

    Raises
    ------
    TextureError
        If it is damaged, its pages differ, it is a picture of few channels, or its wavelengths are unsaid.
    """

    format = "multi-band TIFF"

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path = path
        self._image = open_image(path)
        specs, warnings = _pages_of_bands(self._image, path)
        self._pages, spec = len(specs), specs[0]
        self._samples = int(spec.nchannels)
        self.height, self.width, bands = int(spec.height), int(spec.width), self._pages * self._samples
        self._mapped = _mapped_pages(path, self._pages, (self.height, self.width, bands))
        self.concurrent = bool(self._mapped)
        self._dtype = stored_type(spec, path, self.concurrent)
        if bands > LARGEST_BANDS:
            raise TextureError(f"{bands} bands, more than {LARGEST_BANDS}", where=path, remedy="average neighbours")
        self.wavelengths_nm = frozen(_wavelengths(spec, bands, path, reading))
        self.kind, self.scale = stated_kind(path, reading, self._dtype)
        self.name = path.stem
        self.warnings = warnings + _warnings(spec, self._dtype)
        self._buffer = RowBuffer(self._block, self.height, self._block_rows(spec))

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands). A view of the file if that can be."""
        if self._mapped:
            return _together([image[first : first + count] for image in self._mapped])
        return self._buffer.rows(first, count)

    def _block_rows(self, spec: Any) -> int:
        """Whole strips or tiles: libtiff unpacks them from their beginning, or not at all."""
        unit = int(spec.tile_height) or min(self.height, max(1, spec.get_int_attribute("tiff:RowsPerStrip", 1)))
        row_bytes = self.width * self.bands * self._dtype.itemsize
        rows = block_rows(row_bytes, unit)
        if not self._mapped and min(rows, self.height) * row_bytes > _LARGEST_BLOCK:
            raise TextureError(
                f"its strips hold {unit} rows, {unit * row_bytes / 1e9:.1f} GB of all bands",
                where=self._path,
                remedy="write it with fewer rows per strip, or in tiles",
            )
        return rows

    def _block(self, first: int, count: int) -> Samples:
        samples = (0, self._samples)
        with library_attribute("limits:channels", LARGEST_BANDS):  # looked up again with each page
            return _together(
                [image_rows(self._image, self._path, page, first, count, samples) for page in range(self._pages)]
            )


def _mapped_pages(path: Path, pages: int, shape: tuple[int, int, int]) -> list[Samples]:
    """The pages as views of the file, none if they have to be unpacked."""
    layout = tiff_layout(*tiff_directories(path, pages))
    if layout is None or (*layout.shape[:2], layout.shape[2] * len(layout.starts)) != shape:
        return []
    return mapped(path, layout)


def _together(pages: list[Samples]) -> Samples:
    """Rows (count, width, samples) of all pages as those of one texture, band after band."""
    if len(pages) == 1:
        return pages[0]
    count, width, samples = pages[0].shape
    block = np.empty((len(pages), samples, count, width), dtype=pages[0].dtype)
    for page, rows in enumerate(pages):
        block[page] = rows.transpose(2, 0, 1)
    return block.reshape(-1, count, width).transpose(1, 2, 0)


def _pages_of_bands(image: Any, path: Path) -> tuple[list[Any], tuple[str, ...]]:
    """Specifications of the pages that hold bands, and what to know of the others.

    Raises
    ------
    TextureError
        Naming the first page that differs.
    """
    first = image.spec()
    specs = [first]
    warnings: tuple[str, ...] = ()
    while len(specs) <= LARGEST_BANDS and _seek(image, len(specs)):
        spec = image.spec()
        if _kind_of(spec) != _kind_of(first):
            if first.nchannels >= _FEWEST_BANDS:
                warnings = (f"pages from {len(specs) + 1} on are left out: they are {_kind_of(spec)}",)
                break
            raise TextureError(
                f"page {len(specs) + 1} is {_kind_of(spec)}, the first is {_kind_of(first)}",
                where=path,
                remedy="give pages of one size and type, or one page with all bands",
            )
        specs.append(spec)
    error_text(image)  # that there is no further page is no error
    _seek(image, 0)
    return specs, warnings


def _seek(image: Any, page: int) -> bool:
    with library_attribute("limits:channels", LARGEST_BANDS):
        return bool(image.seek_subimage(page, 0))


def _kind_of(spec: Any) -> str:
    return f"{spec.width} x {spec.height}, {spec.nchannels} samples of {spec.format}"


def _wavelengths(spec: Any, bands: int, path: Path, reading: Reading) -> Float64Array:
    """The user's word first, then the description's.

    Raises
    ------
    TextureError
        If neither says them.
    """
    stated = stated_wavelengths(reading, bands, path)
    if stated is not None:
        return stated
    try:
        description = spec.get_string_attribute("ImageDescription")
    except UnicodeDecodeError:
        description = ""
    found = wavelengths_in_text(description, bands, path)
    if found is not None:
        return checked_wavelengths(found, bands, path)
    if bands < _FEWEST_BANDS:
        raise single_image(path)
    raise ask_for_wavelengths(path, bands)


def _warnings(spec: Any, dtype: np.dtype[Any]) -> tuple[str, ...]:
    warnings: tuple[str, ...] = ()
    bits = spec.get_int_attribute("oiio:BitsPerSample", dtype.itemsize * 8)
    if bits != dtype.itemsize * 8:
        warnings += (f"samples of {bits} bits are scaled to the range of {dtype}",)
    compression = spec.get_string_attribute("compression")
    if compression in _LOSSY:
        warnings += (f"{compression} is lossy: these are not the values that were captured",)
    return warnings
