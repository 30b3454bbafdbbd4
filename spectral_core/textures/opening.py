"""`open_texture`: the format is known from the file's own first bytes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spectral_core.errors import TextureError
from spectral_core.files import is_file, why_no_file
from spectral_core.textures.base import HyperspectralTexture
from spectral_core.textures.envi import EnviTexture
from spectral_core.textures.envi_files import header_beside
from spectral_core.textures.envi_text import begins_header
from spectral_core.textures.numpy_format import NpyTexture, NpzTexture
from spectral_core.textures.reading import Reading
from spectral_core.textures.spectral_exr import SpectralExrTexture

_FORMATS: tuple[tuple[bytes, Callable[[Path, Reading], HyperspectralTexture]], ...] = (
    (b"\x93NUMPY", NpyTexture),
    (b"PK\x03\x04", NpzTexture),
    (b"\x76\x2f\x31\x01", SpectralExrTexture),
)


def open_texture(path: str | Path, reading: Reading | None = None) -> HyperspectralTexture:
    """Open a hyperspectral texture: ``.npy`` with its wavelengths beside it, ``.npz``, spectral
    OpenEXR, ENVI by its header or its data file.

    Raises
    ------
    TextureError
        If the file is missing, of an unknown format, damaged, or not a texture of spectra.
    """
    path = Path(path)
    if not is_file(path):
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
        opened = opener(path, reading or Reading())
        opened.files = opened.files or (path,)
        return opened
    what = "is empty" if not head else "is no texture of a known format"
    raise TextureError(what, where=path, remedy="give .npy, .npz, spectral OpenEXR or ENVI with its header")
