"""One image per wavelength: a folder (``capture``) or a pattern (``capture/*.bmp``).

The published system keeps its textures so: 101 BMPs from 380 to 780 nm in 4 nm. Wavelengths are read
from the names where they plainly hold them (``380.bmp``, ``img_380nm.png``, ``band_0.55um.tif``).
"""

from __future__ import annotations

import fnmatch
import os
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Samples, checked_wavelengths
from spectral_core.textures.images.raster import image_rows, open_image, stored_type
from spectral_core.textures.images.row_buffer import BLOCK_BYTES, RowBuffer, block_rows
from spectral_core.textures.reading import Reading, stated_kind, stated_wavelengths
from spectral_core.textures.wavelengths import ask_for_wavelengths, wavelengths_in_names
from spectral_core.weights import LARGEST_BANDS

_ENDINGS = {".bmp": "bmp", ".png": "png", ".tif": "tiff", ".tiff": "tiff", ".jpg": "jpeg", ".jpeg": "jpeg"}
# Systems let a program open 256 files or more; what is beyond is opened again for each block of rows,
# which is larger then.
_MOST_OPEN = 128
_LARGE_BLOCK_BYTES = 8 * BLOCK_BYTES
# Of stored channels: grey, grey and alpha, RGB, RGB and alpha.
_GREY = {1: 1, 2: 1, 3: 3, 4: 3}


class ImageSequence(HyperspectralTexture):
    """Grey images of one size and type, a band each, decoded some rows at a time.

    Parameters
    ----------
    path
        A folder of images, or a pattern of their names.
    reading
        Its wavelengths belong to the images in the order of their names, numbers by value.

    Raises
    ------
    TextureError
        If there are no images, they differ in size or type, or their names do not say the wavelengths
        and nobody else does. While reading: if an image is damaged or in colour.
    """

    format = "image sequence"

    def __init__(self, path: Path, reading: Reading) -> None:
        paths = _images(path)
        wavelengths, self.warnings = _wavelengths(paths, path, reading)
        order = np.argsort(wavelengths, kind="stable")
        self._paths = [paths[index] for index in order]
        self.wavelengths_nm = frozen(wavelengths[order])
        self.height, self.width, self._channels, self._dtype = _common_shape(self._paths)
        self.kind, self.scale = stated_kind(path, reading, self._dtype)
        # Of "." and "..", too, it is the folder's own name.
        self.name = (path if path.is_dir() else path.parent).resolve().name or "sequence"
        # A folder's own time says nothing of what is written into its images.
        self.files = tuple(self._paths)
        if _ENDINGS[self._paths[0].suffix.lower()] == "jpeg":
            self.warnings += ("JPEG is lossy: these are not the values that were captured",)
        self._open: dict[int, Any] = {}
        row_bytes = self.width * self.bands * self._dtype.itemsize
        largest = BLOCK_BYTES if self.bands <= _MOST_OPEN else _LARGE_BLOCK_BYTES
        self._buffer = RowBuffer(self._block, self.height, block_rows(row_bytes, 1, largest))

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands). Fast from the top down."""
        return self._buffer.rows(first, count)

    def _block(self, first: int, count: int) -> Samples:
        block = np.empty((self.bands, count, self.width), dtype=self._dtype)

        def band(index: int) -> None:
            block[index] = self._grey_rows(index, first, count)

        # Decoders run beside the interpreter.
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(band, range(self.bands)))
        return block.transpose(1, 2, 0)

    def _grey_rows(self, index: int, first: int, count: int) -> Samples:
        """Rows (count, width) of one image."""
        path = self._paths[index]
        # The same ones stay open: those used last would all be closed before they come again.
        image = self._open.get(index) or open_image(path)
        if index < _MOST_OPEN:
            self._open[index] = image
        pixels = image_rows(image, path, 0, first, count, (0, self._channels))
        colours = _GREY[self._channels]
        if any((pixels[..., channel] != pixels[..., 0]).any() for channel in range(1, colours)):
            raise TextureError(
                f"is in colour in the rows from {first} on",
                where=path,
                remedy="give grey images, or the three channels as three images",
            )
        if colours < self._channels and not _opaque(pixels[..., -1]):
            raise TextureError("is transparent in places", where=path, remedy="save it without an alpha channel")
        return pixels[..., 0]


def is_sequence(path: Path) -> bool:
    """Whether a path that names no file is a folder or a pattern of file names."""
    try:
        return path.is_dir() or any(character in path.name for character in "*?[")
    except OSError:  # too long a name
        return False


def single_image(path: Path) -> TextureError:
    """The error for one plain image where a texture is wanted."""
    channels = int(open_image(path).spec().nchannels)
    return TextureError(
        f"has only {channels} channel{'s' if channels > 1 else ''}",
        where=path,
        remedy=f"give the folder with one image per wavelength, or a pattern like '*{path.suffix}'",
    )


def _images(path: Path) -> list[Path]:
    """The images of a folder or pattern, in the order of their names with numbers by value."""
    try:
        folder, pattern = (path, "*") if path.is_dir() else (path.parent, path.name)
        files = [
            each
            for each in folder.iterdir()
            if each.suffix.lower() in _ENDINGS
            and not each.name.startswith(".")  # of macOS, beside the images
            and fnmatch.fnmatchcase(each.name, pattern)
            and each.is_file()
        ]
    except OSError as error:
        raise TextureError(
            f"cannot be searched ({error.strerror})", where=path, remedy="name a folder of images"
        ) from None
    endings = {_ENDINGS[each.suffix.lower()] for each in files}
    if len(endings) > 1:
        raise TextureError(
            f"holds images of several formats ({', '.join(sorted(endings))})",
            where=path,
            remedy="give a pattern like '*.png'",
        )
    if not 2 <= len(files) <= LARGEST_BANDS:
        raise TextureError(
            f"holds {len(files)} images (BMP, PNG, TIFF)" if files else "holds no images (BMP, PNG, TIFF)",
            where=path,
            remedy=f"give a folder or pattern with one per wavelength, 2 to {LARGEST_BANDS}",
        )
    return sorted(files, key=_by_numbers)


def _by_numbers(path: Path) -> list[tuple[str, float]]:
    """Sorting key: ``10.bmp`` comes after ``9.bmp``."""
    parts = re.split(r"(\d+)", path.stem)
    return [
        (text.casefold(), float(number)) for text, number in zip(parts[::2], [*parts[1::2], "inf"], strict=True)
    ]  # fmt: skip


def _wavelengths(paths: Sequence[Path], path: Path, reading: Reading) -> tuple[Float64Array, tuple[str, ...]]:
    """Wavelengths (images,), the user's word first, and what to know of them."""
    named, why = wavelengths_in_names([each.stem for each in paths])
    stated = stated_wavelengths(reading, len(paths), path)
    if stated is not None:
        if named is not None and not np.allclose(named, stated):
            return stated, (f"the names say {named.min():g} to {named.max():g} nm; what was given is used instead",)
        return stated, ()
    if named is None:
        first, last = paths[0].name[:40], paths[-1].name[:40]
        raise ask_for_wavelengths(path, len(paths), f"{why} ({first} to {last})")
    return checked_wavelengths(named, len(paths), path), ()


def _common_shape(paths: Sequence[Path]) -> tuple[int, int, int, np.dtype[Any]]:
    """Height, width, channels and type of all images, from their headers alone.

    Raises
    ------
    TextureError
        Naming the first image that differs from those before it.
    """
    common = None
    for path in paths:
        image = open_image(path)
        spec = image.spec()
        shape = (int(spec.height), int(spec.width), int(spec.nchannels), stored_type(spec, path))
        if shape[2] not in _GREY:
            raise TextureError(
                f"has {shape[2]} channels",
                where=path,
                remedy="give grey images, or this one alone if it is a multi-band TIFF",
            )
        if image.seek_subimage(1, 0) and (image.spec().height, image.spec().width) == shape[:2]:
            raise TextureError(
                "has several pages", where=path, remedy="give it alone if it is a multi-band TIFF, or save one page"
            )
        if common is not None and shape != common:
            raise TextureError(
                f"is {_described(shape)}, {paths[0].name} is {_described(common)}",
                where=path,
                remedy="give images of one size and type",
            )
        common = shape
    assert common is not None  # there are two images at least
    return common


def _described(shape: tuple[int, int, int, np.dtype[Any]]) -> str:
    height, width, channels, dtype = shape
    return f"{width} x {height}, {channels} channel{'s' if channels > 1 else ''} of {dtype}"


def _opaque(alpha: Samples) -> bool:
    full = np.iinfo(alpha.dtype).max if alpha.dtype.kind in "iu" else 1
    return bool((alpha == full).all())
