"""Reflectance from counts or radiance through captures of a white reference and of darkness.

``reflectance = (samples - dark) / (white - dark)``, column by column where the references are as wide
as the texture: a line scanner's lamp and sensor differ along the line, not along the scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.spectra import read_spectra
from spectral_core.textures.base import HyperspectralTexture
from spectral_core.textures.derived import DerivedTexture
from spectral_core.textures.reading import Reading

# Instruments write their bands with two decimals or more.
_SAME_NM = 0.01
# A column is saturated if more of its pixels are: what fewer of them hide is below what a white is known to.
_SATURATED_SHARE = 0.01

Open = Callable[[Path, Reading], HyperspectralTexture]


@dataclass(frozen=True)
class _Reference:
    """A reference averaged over its rows: values, and where they are saturated, (bands,) or (width, bands)."""

    values: Float64Array
    saturated: BoolArray
    good: BoolArray
    warnings: tuple[str, ...] = ()


class CalibratedTexture(DerivedTexture):
    """A texture of counts or radiance as reflectance: its samples stay as stored, gain and dark are new.

    Parameters
    ----------
    texture
        What was captured.
    white, dark
        (bands,) or (width, bands), in the units of the texture's values.
    unusable
        Of the same shape as the white: where it is saturated.
    good
        (bands,), of the references.
    """

    def __init__(
        self,
        texture: HyperspectralTexture,
        white: Float64Array,
        dark: Float64Array,
        unusable: BoolArray,
        good: BoolArray,
    ) -> None:
        super().__init__(texture)
        self.kind, self.scale = "reflectance", 1.0
        span, usable, replaced = _span(white - dark, unusable)
        self._good = texture.good & good & usable
        if not self._good.any():
            raise TextureError(
                "no band has a white reference that is brighter than the dark one and not saturated",
                where=texture.name,
                remedy="capture them again, with a shorter exposure if they are saturated",
            )
        # values = (samples - dark_0) * gain_0, so that (values - dark) / span is the same form again.
        self._dark = _shared(texture.dark + _finite(dark) / np.where(texture.gain == 0, 1.0, texture.gain))
        # Bad bands are black instead of infinite: nobody may use them.
        self._gain = _shared(np.where(self._good, texture.gain / np.where(self._good, span, 1.0), 0.0))
        self.warnings = (*texture.warnings, *_warnings(texture, usable & good, replaced))

    @property
    def gain(self) -> Float64Array:
        """(bands,) or (width, bands): reflectance per stored unit, 0 for bad bands."""
        return self._gain

    @property
    def dark(self) -> Float64Array:
        """(bands,) or (width, bands): stored value that stands for 0."""
        return self._dark

    @property
    def good(self) -> BoolArray:
        """(bands,): False too where the references are saturated or the white is not above the dark."""
        return self._good


def calibrated(texture: HyperspectralTexture, reading: Reading, opens: Open) -> HyperspectralTexture:
    """`texture` divided by the white reference that `reading` names, darkness taken from both.

    Parameters
    ----------
    texture
        Of counts, radiance, or unstated.
    reading
        Its white and perhaps its dark reference: captures with the same bands, or a CSV of one spectrum.
    opens
        `open_texture`, by which references are opened.

    Raises
    ------
    TextureError, SpectrumError
        If a reference cannot be read, has other bands, or leaves no band usable.
    """
    if reading.white is None:
        return texture
    if texture.kind == "reflectance":
        raise TextureError(
            "holds reflectance already",
            where=texture.name,
            remedy="leave the white reference out, or say with --kind what it is",
        )
    plain = replace(reading, white=None, dark=None)
    white = _reference(reading.white, texture, plain, opens)
    dark = _Reference(np.zeros(texture.bands), np.zeros(texture.bands, bool), np.ones(texture.bands, bool))
    if reading.dark is not None:
        dark = _reference(reading.dark, texture, plain, opens)
    unusable = white.saturated | dark.saturated
    result = CalibratedTexture(texture, white.values, dark.values, unusable, white.good & dark.good)
    result.warnings += white.warnings + dark.warnings
    return result


def _reference(path: Path, texture: HyperspectralTexture, reading: Reading, opens: Open) -> _Reference:
    if path.suffix.lower() in (".csv", ".txt"):
        values, warnings = _spectrum(path, texture)
        return _Reference(values, np.zeros(values.shape, bool), np.ones(values.shape, bool), warnings)
    found = opens(path, reading)
    if found.bands != texture.bands or np.abs(found.wavelengths_nm - texture.wavelengths_nm).max() > _SAME_NM:
        raise TextureError(
            f"its {found.bands} bands from {found.wavelengths_nm[0]:g} to {found.wavelengths_nm[-1]:g} nm are not "
            f"those of '{texture.name}' ({texture.bands}, {texture.wavelengths_nm[0]:g} to "
            f"{texture.wavelengths_nm[-1]:g} nm)",
            where=path,
            remedy="capture the reference with the same settings",
        )
    if "unstated" not in (kinds := {found.kind, texture.kind}) and len(kinds) > 1:
        raise TextureError(
            f"holds {found.kind}, '{texture.name}' holds {texture.kind}",
            where=path,
            remedy="give both in the same units, or say with --kind what they are",
        )
    return _average(found, per_column=found.width == texture.width)


def _spectrum(path: Path, texture: HyperspectralTexture) -> tuple[Float64Array, tuple[str, ...]]:
    """A table of one spectrum at the texture's bands, (bands,), interpolated where they lie between its rows."""
    spectra = read_spectra(path, "power")
    if len(spectra.values) != 1 or spectra.lines:
        raise TextureError(
            f"holds {len(spectra.values)} spectra", where=path, remedy="give a table of one: wavelength in nm, value"
        )
    table, bands = spectra.wavelengths_nm, texture.wavelengths_nm
    if bands.min() < table[0] - _SAME_NM or bands.max() > table[-1] + _SAME_NM:
        raise TextureError(
            f"covers {table[0]:g} to {table[-1]:g} nm, the texture {bands.min():g} to {bands.max():g} nm",
            where=path,
            remedy="measure the reference over all bands",
        )
    at_bands = np.abs(table[:, None] - bands).min(axis=0).max() <= _SAME_NM
    if texture.kind == "counts" and not at_bands:
        raise TextureError(
            "is no table of the bands' own counts",
            where=path,
            remedy=f"give counts at the {texture.bands} bands of '{texture.name}', or a capture",
        )
    warnings = () if at_bands else (f"{path.name}: interpolated from its {len(table)} wavelengths to the bands",)
    return np.interp(bands, table, spectra.values[0]), warnings


def _average(texture: HyperspectralTexture, per_column: bool) -> _Reference:
    """Mean of all rows, in float64: (width, bands), or (bands,) of all columns that are usable."""
    shape = (texture.width, texture.bands)
    total, full = np.zeros(shape), np.zeros(shape, dtype=np.int64)
    step = texture.rows_per_tile()
    for first in range(0, texture.height, step):
        rows = texture.samples(first, min(step, texture.height - first))
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is found where it is used
            total += rows.sum(axis=0, dtype=np.float64)
        if texture.ignore_value is not None:
            total[(rows == texture.ignore_value).any(axis=0)] = np.nan
        if rows.dtype.kind in "iu":
            full += (rows == np.iinfo(rows.dtype).max).sum(axis=0)
    mean = (total / texture.height - texture.dark) * texture.gain
    saturated = full / texture.height > _SATURATED_SHARE
    warnings = tuple(f"{texture.name}: {each}" for each in texture.warnings)
    if per_column:
        return _Reference(mean, saturated, texture.good, warnings)
    usable = np.isfinite(mean) & ~saturated
    left_out = int((~usable).sum())
    if left_out:
        warnings += (f"{texture.name}: {left_out} columns, over all bands, are no part of its mean",)
    mean = np.where(usable, mean, 0).sum(axis=0) / np.maximum(1, usable.sum(axis=0))
    return _Reference(mean, usable.mean(axis=0) < 0.5, texture.good, warnings)


def _span(span: Float64Array, unusable: BoolArray) -> tuple[Float64Array, BoolArray, int]:
    """White less dark where it can be divided by, which bands it can be in, and how many columns were replaced.

    A column that cannot be used gets its band's mean of those that can, if they are at least half.
    """
    span, unusable = np.broadcast_arrays(span, unusable)
    usable = np.isfinite(span) & (span > 0) & ~unusable
    if span.ndim == 1:
        return span, usable, 0
    bands = usable.mean(axis=0) >= 0.5
    mean = np.where(usable, span, 0).sum(axis=0) / np.maximum(1, usable.sum(axis=0))
    return np.where(usable, span, mean), bands, int((~usable[:, bands]).sum())


def _finite(values: Float64Array) -> Float64Array:
    """Columns that are no numbers take their band's mean, as those of the white do; 0 where there is none."""
    finite = np.isfinite(values)
    known = np.where(finite, values, 0)
    if values.ndim == 1:
        return known
    return np.where(finite, values, known.sum(axis=0) / np.maximum(1, finite.sum(axis=0)))


def _shared(values: Float64Array) -> Float64Array:
    """(bands,) if all columns are the same, else as they are; nobody may write to it."""
    return frozen(values[0] if values.ndim == 2 and (values == values[0]).all() else values)


def _warnings(texture: HyperspectralTexture, usable: BoolArray, replaced: int) -> tuple[str, ...]:
    warnings: tuple[str, ...] = ("reflectance is relative to the white reference, whose own is taken as 1",)
    bad = texture.wavelengths_nm[~usable & texture.good]
    if bad.size:
        where = f"{bad.min():g} nm" if bad.size == 1 else f"among {bad.min():g} to {bad.max():g} nm"
        warnings += (
            f"{bad.size} of {texture.bands} bands left out ({where}): a reference is saturated there, or the white "
            "not brighter than the dark",
        )
    if replaced:
        warnings += (f"{replaced} columns of the white reference, over all bands, are replaced by their band's mean",)
    return warnings
