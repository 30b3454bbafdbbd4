"""Spectral OpenEXR, layout 1.0 (Fichet, Pacanowski, Wilkie 2021), through OpenImageIO.

Polarised and fluorescent files hold what a texture per lamp cannot show: they are refused, or
reduced to what it can if the reading says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import frozen
from spectral_core.errors import TextureError
from spectral_core.imaging import error_text, oiio
from spectral_core.textures.base import HyperspectralTexture, Samples, checked_size, checked_wavelengths
from spectral_core.textures.images.exr_channels import SpectralChannels, spectral_channels
from spectral_core.textures.images.raster import check_promise, library_attribute
from spectral_core.textures.reading import Reading, stated_kind

# Stereo, layers and levels of a renderer; more is damage.
_MOST_PARTS = 1000
# Bispectral files hold half the square of their bands.
_MOST_CHANNELS = 1 << 16


class SpectralExrTexture(HyperspectralTexture):
    """A spectral OpenEXR image of reflectance or radiance, in one part or several of one size."""

    format = "spectral OpenEXR"

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path = path
        # The older reader, the default before OpenImageIO 3.1, prints its own lines on damaged files.
        with library_attribute("openexr:core", 1), library_attribute("limits:channels", _MOST_CHANNELS):
            self._input = oiio().ImageInput.open(str(path))
            if self._input is None:
                what = f"is not an OpenEXR image ({error_text(oiio())})"
                raise TextureError(what, where=path, remedy="write it again")
            self._specs = self._parts()
        channels = spectral_channels([_names(spec, path) for spec in self._specs], path)
        self._spec = self._common_spec(channels)
        # Names have six decimals: what the unit's conversion adds beyond them is noise.
        wavelengths = np.round([band.wavelength_nm for band in channels.bands], 6)
        self.wavelengths_nm = frozen(checked_wavelengths(wavelengths, len(channels.bands), path))
        self._channels = [(band.part, band.channel) for band in channels.bands]
        self.height, self.width = int(self._spec.height), int(self._spec.width)
        self.kind, self.scale = stated_kind(path, reading, np.dtype(np.float32), channels.kind)
        self.name = path.stem
        self._leave_out(channels, reading.reduce)

    def rows_per_tile(self) -> int:
        """Rows that fill a tile, in whole rows of the file's own tiles if it has some."""
        rows, tile = super().rows_per_tile(), int(self._spec.tile_height)
        return -(-rows // tile) * tile if tile else rows

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands), float32."""
        return self._read(self._channels, first, count)

    def _parts(self) -> list[Any]:
        """Specifications of all parts, the first as it was opened."""
        specs = [self._input.spec()]
        while len(specs) < _MOST_PARTS and self._input.seek_subimage(len(specs), 0):
            specs.append(self._input.spec())
        error_text(self._input)  # that there is no further part is no error
        self._input.seek_subimage(0, 0)
        return specs

    def _common_spec(self, channels: SpectralChannels) -> Any:
        """The specification that all parts with spectral channels share."""
        used = {part for part, _ in _all_channels(channels)}
        specs = [self._specs[part] for part in sorted(used)]
        if any(spec.deep for spec in specs):
            raise TextureError("is a deep image", where=self._path, remedy="flatten it")
        if len({(s.x, s.y, s.width, s.height) for s in specs}) > 1:
            sizes = sorted({f"{s.width} x {s.height} at {s.x}, {s.y}" for s in specs})
            raise TextureError(
                f"its parts differ in size ({'; '.join(sizes[:4])})",
                where=self._path,
                remedy="write all spectral channels with one data window",
            )
        checked_size(int(specs[0].width), int(specs[0].height), self._path)
        for spec in specs:
            check_promise(spec, 4, self._path)
        return specs[0]

    def _leave_out(self, channels: SpectralChannels, reduce: bool) -> None:
        """Refuse, or leave out and say so, what no texture can show; channels of zeros are nothing.

        Raises
        ------
        TextureError
            If it would be left out unasked.
        """
        if channels.polarised and self._any_value(channels.polarised):
            if not reduce:
                raise TextureError(
                    "is polarised (Stokes S1 to S3)",
                    where=self._path,
                    remedy="keep only the S0 channels, or give --reduce to show their intensity alone",
                )
            self.warnings += (
                f"polarised: {len(channels.polarised)} channels of Stokes S1 to S3 are left out; the intensity S0 "
                "stays",
            )
        if channels.fluorescent and self._any_value(channels.fluorescent):
            if not reduce:
                raise TextureError(
                    "is bispectral (fluorescent): its colour under a lamp is no product of spectra",
                    where=self._path,
                    remedy="give the reflectance without fluorescence, or --reduce to leave fluorescence out",
                )
            self.fluorescent = True
            self.warnings += (
                f"fluorescent: {len(channels.fluorescent)} channels of light that goes out at another wavelength than "
                "it came in are left out; the reflectance stays, which is too dark where the surface glows",
            )

    def _any_value(self, channels: tuple[tuple[int, int], ...]) -> bool:
        """Whether any pixel of these channels is not zero."""
        step = max(1, self.rows_per_tile())
        return any(
            bool(self._read(list(channels), first, min(step, self.height - first)).any())
            for first in range(0, self.height, step)
        )

    def _read(self, channels: list[tuple[int, int]], first: int, count: int) -> Samples:
        """Rows of (part, channel) pairs: (count, width, channels), float32; a view if they stand in a row."""
        parts = {part for part, _ in channels}
        if len(parts) == 1:
            return self._part_rows(channels[0][0], [channel for _, channel in channels], first, count)
        result = np.empty((count, self.width, len(channels)), dtype=np.float32)
        for part in sorted(parts):
            places = [place for place, (each, _) in enumerate(channels) if each == part]
            result[..., places] = self._part_rows(part, [channels[place][1] for place in places], first, count)
        return result

    def _part_rows(self, part: int, numbers: list[int], first: int, count: int) -> Samples:
        spec, low, high = self._specs[part], min(numbers), max(numbers) + 1
        tile = int(spec.tile_height)
        begin, end = first, first + count
        if tile:
            begin, end = first // tile * tile, min(self.height, -(-end // tile) * tile)
        top, bottom = spec.y + begin, spec.y + end
        with library_attribute("limits:channels", _MOST_CHANNELS):  # looked up again with each part
            if tile:
                columns = (spec.x, spec.x + self.width)
                pixels = self._input.read_tiles(part, 0, *columns, top, bottom, 0, 1, low, high, "float")
            else:
                pixels = self._input.read_scanlines(part, 0, top, bottom, 0, low, high, "float")
        if pixels is None:
            raise TextureError(
                f"row {first} cannot be read ({error_text(self._input)})",
                where=self._path,
                remedy="the file is damaged; write it again",
            )
        rows: Samples = np.asarray(pixels).reshape(end - begin, self.width, high - low)
        rows = rows[first - begin : first - begin + count]
        return rows if numbers == list(range(low, high)) else rows[..., [number - low for number in numbers]]


def _all_channels(channels: SpectralChannels) -> Iterator[tuple[int, int]]:
    yield from ((band.part, band.channel) for band in channels.bands)
    yield from channels.polarised
    yield from channels.fluorescent


def _names(spec: Any, path: Path) -> tuple[str, ...]:
    try:
        return tuple(spec.channelnames)
    except UnicodeDecodeError:
        raise TextureError("has damaged channel names", where=path, remedy="write it again") from None
