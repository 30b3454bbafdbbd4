"""ENVI spectral libraries: a header of text and a table of one spectrum a line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.errors import SpectrumError, TextureError
from spectral_core.textures.envi.channels import (
    calibration,
    good_channels,
    ignore_value,
    is_light,
    reflectance_scale,
    refuse_other_than_light,
    refuse_repeated,
    wavelengths_nm,
)
from spectral_core.textures.envi.files import header_and_data, header_beside, is_header
from spectral_core.textures.envi.header import EnviHeader, read_header
from spectral_core.textures.reading import Reading

# As many as a table in CSV may have.
_MOST_WAVELENGTHS = 20_000
# 256 MB of float64; the largest public libraries have a tenth of it.
_MOST_VALUES = 1 << 25
# What channels that were left out hold in the libraries of the U.S. Geological Survey: -1.23e34.
_DELETED = -1e30
# Beyond it nothing is seen: a spectrum need not have data there.
_VISIBLE_NM = (360.0, 830.0)


@dataclass(frozen=True)
class Library:
    """Spectra of a library.

    Attributes
    ----------
    names
        One per spectrum; empty if the file gives none.
    wavelengths_nm
        (n,), ascending.
    values
        (spectra, n), divided by the library's reflectance scale factor.
    warnings
        What was left out, sorted or assumed.
    """

    names: tuple[str, ...]
    wavelengths_nm: Float64Array
    values: Float64Array
    warnings: tuple[str, ...]


def is_envi(path: Path) -> bool:
    """Whether `path` is an ENVI header, or the data file of an ENVI spectral library by its header."""
    if is_header(path):
        return True
    header = header_beside(path)
    if header is None:
        return False
    try:
        return read_header(header).is_library
    except TextureError:
        return False


def read_library(path: Path) -> Library:
    """Read a spectral library by the path of its header or its data file.

    Wavelengths are sorted. Left out are those that the header calls bad and those that are not of
    light; spectra that lack data where light is seen; and wavelengths elsewhere where one lacks data.

    Raises
    ------
    SpectrumError
        If it is an image, damaged or too large, or its wavelengths are missing or repeated.
    """
    try:
        header_path, data = header_and_data(path)
        header = read_header(header_path)
        _check_size(header)
        wavelengths, of_wavelengths = _wavelengths(header)
        used = good_channels(header) & is_light(wavelengths)
        refuse_repeated(wavelengths, used, header)
        ignored, of_ignored = ignore_value(header)
        scale, of_scale = _scale(header)
        stored = header.mapped(data)[:, :, 0]
    except TextureError as error:
        raise SpectrumError(error.problem, where=error.where, remedy=error.remedy) from None
    order = np.argsort(wavelengths)
    order = order[used[order]]
    stored = stored[:, order]
    missing = ~np.isfinite(stored) | (stored < _DELETED)
    if ignored is not None:
        missing |= stored == ignored
    names, of_names = _names(header)
    spectra, kept, of_missing = _with_data(wavelengths[order], missing, header)
    return Library(
        tuple(names[index] for index in np.flatnonzero(spectra)) if names else (),
        wavelengths[order][kept],
        stored[spectra][:, kept].astype(np.float64) / scale,
        (
            *header.warnings, *of_wavelengths, *_order_warning(wavelengths, used), *of_ignored, *of_scale, *of_names,
            *of_missing,
        ),
    )  # fmt: skip


def _check_size(header: EnviHeader) -> None:
    if not header.is_library:
        raise TextureError(
            "is an ENVI image, not a table of spectra", where=header.path, remedy="open it as a texture instead"
        )
    if header.bands != 1:
        raise TextureError(
            f"has {header.bands} bands, and a spectral library one", where=header.path, remedy="write it again"
        )
    if header.samples > _MOST_WAVELENGTHS:
        raise TextureError(
            f"{header.samples} wavelengths, more than {_MOST_WAVELENGTHS}",
            where=header.path,
            remedy="average neighbouring ones",
        )
    if header.samples * header.lines > _MOST_VALUES:
        raise TextureError(
            f"{header.lines:,} spectra of {header.samples} wavelengths, more than {_MOST_VALUES:,} values",
            where=header.path,
            remedy="split it",
        )


def _wavelengths(header: EnviHeader) -> tuple[Float64Array, list[str]]:
    values, warnings = wavelengths_nm(header)
    if values is None:
        raise TextureError("does not say its wavelengths", where=header.path, remedy="give 'wavelength' in the header")
    if not is_light(values).any():
        refuse_other_than_light(values, header)
    return values, warnings


def _scale(header: EnviHeader) -> tuple[float, list[str]]:
    """Of the header, 1 where it gives none; what is then no reflectance is seen by its size."""
    if calibration(header, Reading()).gain is not None:
        raise TextureError(
            "gives gains, which are not read of a spectral library", where=header.path, remedy="write calibrated values"
        )
    scale, warnings = reflectance_scale(header)
    return scale or 1.0, warnings


def _order_warning(wavelengths: Float64Array, used: BoolArray) -> list[str]:
    warnings = []
    if not used.all():
        count = f"{int((~used).sum())} of {len(used)}"
        warnings.append(f"{count} wavelengths are left out: called bad by the header, or beyond 100 to 5000 nm")
    steps = np.diff(wavelengths[used])
    if (steps > 0).any() and (steps < 0).any():
        warnings.append("the wavelengths were out of order; sorted")
    return warnings


def _names(header: EnviHeader) -> tuple[tuple[str, ...], list[str]]:
    """Names of the spectra, none if there are not as many: a comma in one would shift all that follow."""
    names = header.text.words("spectra names", header.lines)
    if len(names) in (0, header.lines):
        return names, []
    return (), [f"the header does not give {header.lines} names for as many spectra; they are numbered"]


def _with_data(
    wavelengths: Float64Array, missing: BoolArray, header: EnviHeader
) -> tuple[BoolArray, BoolArray, list[str]]:
    """Which spectra and which wavelengths to keep so that no value is missing, (spectra, n)."""
    seen = (wavelengths >= _VISIBLE_NM[0]) & (wavelengths <= _VISIBLE_NM[1])
    spectra = ~missing[:, seen].any(axis=1)
    if not spectra.any():
        raise SpectrumError(
            f"none of the {len(missing)} spectra has data all over the visible range",
            where=header.path,
            remedy="give spectra measured between 380 and 780 nm",
        )
    kept = ~missing[spectra].any(axis=0)
    warnings = []
    if not spectra.all():
        warnings.append(
            f"{int((~spectra).sum())} of {len(spectra)} spectra are left out: they lack data where light is seen"
        )
    if not kept.all():
        warnings.append(f"{int((~kept).sum())} of {len(kept)} wavelengths are left out: some spectra lack data there")
    return spectra, kept, warnings
