"""Spectral OpenEXR, layout 1.0 (Fichet, Pacanowski, Wilkie 2021), through OpenImageIO.

Reflective channels are called ``T.450,000000nm``, emissive ones ``S0.450,000000nm``. Polarised
files (``S1`` to ``S3``) and bispectral ones (``T.in.out``) hold what a texture per lamp cannot
show and are refused.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import frozen
from spectral_core.errors import TextureError
from spectral_core.imaging import error_text, oiio
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples, checked_wavelengths
from spectral_core.textures.reading import Reading

_NUMBER = r"(\d*,?\d*(?:[Ee][+-]?\d+)?)"
_UNIT = r"(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)"
_CHANNEL = re.compile(rf"^(?:.*\.)?(S[0-3]|T)\.{_NUMBER}{_UNIT}$")
_BISPECTRAL = re.compile(rf"^(?:.*\.)?T\.{_NUMBER}{_UNIT}\.{_NUMBER}{_UNIT}$")
_PREFIX = {
    "Y": 1e24, "Z": 1e21, "E": 1e18, "P": 1e15, "T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "h": 1e2, "da": 1e1,
    "": 1.0, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12,
}  # fmt: skip
_SPEED_OF_LIGHT = 299_792_458.0


class SpectralExrTexture(HyperspectralTexture):
    """A spectral OpenEXR image of reflectance or radiance."""

    format = "spectral OpenEXR"

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path = path
        self._input = oiio().ImageInput.open(str(path))
        if self._input is None:
            raise TextureError(f"is not an OpenEXR image ({error_text(oiio())})", where=path, remedy="write it again")
        spec = self._input.spec()
        try:
            names = spec.channelnames
        except UnicodeDecodeError:
            raise TextureError("has damaged channel names", where=path, remedy="write it again") from None
        _refuse_what_cannot_be_shown(names, path)
        self.kind, channels = _spectral_channels(names, path)
        wavelengths, self._channels = zip(*sorted(channels), strict=True)
        # Names have six decimals: what the unit's conversion adds beyond them is noise.
        self.wavelengths_nm = frozen(checked_wavelengths(np.round(wavelengths, 6), len(channels), path))
        self.height, self.width = int(spec.height), int(spec.width)
        self._origin_y = int(spec.y)
        self._tile_rows = int(spec.tile_height)
        self.name = path.stem

    def rows_per_tile(self) -> int:
        """Rows that fill a tile, in whole rows of the file's own tiles if it has some."""
        rows = super().rows_per_tile()
        return -(-rows // self._tile_rows) * self._tile_rows if self._tile_rows else rows

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands), float32."""
        channels = list(self._channels)
        low, high = min(channels), max(channels) + 1
        if self._tile_rows:
            pixels = self._tiled_rows(first, count, low, high)
        else:
            top = self._origin_y + first
            pixels = self._input.read_scanlines(0, 0, top, top + count, 0, low, high, "float")
        if pixels is None:
            raise TextureError(
                f"row {first} cannot be read ({error_text(self._input)})",
                where=self._path,
                remedy="the file is damaged; write it again",
            )
        return np.ascontiguousarray(
            np.asarray(pixels).reshape(count, self.width, high - low)[..., [c - low for c in channels]]
        )

    def _tiled_rows(self, first: int, count: int, low: int, high: int) -> Any:
        spec = self._input.spec()
        begin = first // self._tile_rows * self._tile_rows
        end = min(self.height, -(-(first + count) // self._tile_rows) * self._tile_rows)
        pixels = self._input.read_tiles(
            0, 0, spec.x, spec.x + self.width, spec.y + begin, spec.y + end, 0, 1, low, high, "float"
        )
        if pixels is None:
            return None
        return np.asarray(pixels).reshape(end - begin, self.width, high - low)[first - begin : first - begin + count]


def _refuse_what_cannot_be_shown(names: tuple[str, ...], path: Path) -> None:
    if any(_BISPECTRAL.match(name) for name in names):
        raise TextureError(
            "is bispectral (fluorescent): its colour under a lamp is no product of spectra",
            where=path,
            remedy="give the non-fluorescent reflectance",
        )
    parts = {match.group(1) for name in names if (match := _CHANNEL.match(name))}
    if parts & {"S1", "S2", "S3"}:
        raise TextureError("is polarised (Stokes S1 to S3)", where=path, remedy="keep only the S0 channels")
    if {"S0", "T"} <= parts:
        raise TextureError(
            "mixes reflective (T) and emissive (S0) channels", where=path, remedy="split the file in two"
        )


def _spectral_channels(names: tuple[str, ...], path: Path) -> tuple[Kind, list[tuple[float, int]]]:
    """Kind and (wavelength in nm, channel) of the spectral channels."""
    channels, kind = [], "reflectance"
    for index, name in enumerate(names):
        match = _CHANNEL.match(name)
        if not match:
            continue
        part, number, prefix, unit = match.groups()
        try:
            value = float(number.replace(",", ".")) * _PREFIX[prefix or ""]
        except ValueError:
            raise TextureError(
                f"channel '{name}' has no wavelength", where=path, remedy="name channels like T.450,000000nm"
            ) from None
        if value <= 0:
            raise TextureError(
                f"channel '{name}' has no wavelength", where=path, remedy="name channels like T.450,000000nm"
            )
        channels.append(((_SPEED_OF_LIGHT / value if unit == "Hz" else value) * 1e9, index))
        kind = "radiance" if part == "S0" else "reflectance"
    if not channels:
        raise TextureError(
            f"has no spectral channels, only {', '.join(names[:5])}",
            where=path,
            remedy="give channels like T.450,000000nm (Fichet et al. 2021)",
        )
    return kind, channels  # type: ignore[return-value]
