"""`open_texture`: the format is known from the file's own first bytes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spectral_core.errors import TextureError
from spectral_core.files import is_file, why_no_file
from spectral_core.textures.base import HyperspectralTexture
from spectral_core.textures.envi.files import header_beside
from spectral_core.textures.envi.text import begins_header
from spectral_core.textures.envi.texture import EnviTexture
from spectral_core.textures.images.multiband_tiff import MultibandTiff
from spectral_core.textures.images.raster import PICTURES, TIFFS
from spectral_core.textures.images.sequence import ImageSequence, is_sequence, single_image
from spectral_core.textures.images.spectral_exr import SpectralExrTexture
from spectral_core.textures.matlab.texture import MatlabTexture
from spectral_core.textures.numpy_format import NpyTexture, NpzTexture
from spectral_core.textures.reading import Reading
from spectral_core.textures.references import calibrated

_FORMATS: tuple[tuple[bytes, Callable[[Path, Reading], HyperspectralTexture]], ...] = (
    (b"\x93NUMPY", NpyTexture),
    (b"PK\x03\x04", NpzTexture),
    (b"\x76\x2f\x31\x01", SpectralExrTexture),
    (b"MATLAB 5", MatlabTexture),
    (b"MATLAB 7", MatlabTexture),
    (b"\x89HDF\r\n\x1a\n", MatlabTexture),
    *((signature, MultibandTiff) for signature in TIFFS),
)


def open_texture(path: str | Path, reading: Reading | None = None) -> HyperspectralTexture:
    """Open a hyperspectral texture: ENVI by its header or its data file, ``.npy`` with its wavelengths beside it,
    ``.npz``, spectral OpenEXR, multi-band TIFF, MATLAB, or a folder or pattern (``capture/*.bmp``) of one image
    per wavelength.

    With a white reference in `reading` it becomes reflectance.

    Raises
    ------
    TextureError
        If the file is missing, of an unknown format, damaged, or not a texture of spectra; also if a
        reference does not fit.
    SpectrumError
        If a reference is a table that cannot be used.
    MissingExtraError
        If the format needs a package that is not installed.
    """
    reading = reading or Reading()
    opened = _opened(Path(path), reading)
    opened.files = opened.files or (Path(path),)
    return calibrated(opened, reading, open_texture)


def _opened(path: Path, reading: Reading) -> HyperspectralTexture:
    """The texture as its file has it."""
    if not is_file(path):
        if is_sequence(path):
            return ImageSequence(path, reading)
        raise TextureError(why_no_file(path), where=path, remedy="name a texture file")
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError as error:
        raise TextureError(f"cannot be read ({error.strerror})", where=path, remedy="check its permissions") from None
    opener = next((texture for signature, texture in _FORMATS if head.startswith(signature)), None)
    if opener is None and (begins_header(head) or header_beside(path)):
        opener = EnviTexture
    if opener is not None:
        return opener(path, reading)
    if head.startswith(PICTURES):
        raise single_image(path)
    raise TextureError(
        "is empty" if not head else "is no texture of a known format",
        where=path,
        remedy="give ENVI, .npy, .npz, spectral OpenEXR, multi-band TIFF, MATLAB or a folder of images",
    )
