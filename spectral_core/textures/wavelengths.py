"""Wavelengths that texts, file names and arrays plainly state; anything less plain is asked for."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import TextureError
from spectral_core.textures.base import checked_wavelengths

# Ultraviolet to short-wave infrared; no number fits both units.
_NANOMETRES = (100.0, 5000.0)
_MICROMETRES = (0.1, 5.0)
_LONGEST_TEXT = 1 << 20
_LIST = re.compile(r"\bwavelengths?(?:_nm)?\s*[=:]\s*[\{\[]([^\{\}\[\]]*)[\}\]]", re.IGNORECASE)
_KEY = re.compile(r"wavelengths?([ _]?\(?nm\)?)?", re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
# 450_5 may be 450.5.
_BEFORE_DECIMALS = {"_", "-", ".", ",", "p"}
_WITH_UNIT = re.compile(
    r"(\d+(?:[.,]\d+)?)[ _-]?(nm|nanomet\w*|um|[µμ]m|micron\w*|micromet\w*)(?![a-z])", re.IGNORECASE
)


def ask_for_wavelengths(path: Path, bands: int, why: str = "does not say its wavelengths") -> TextureError:
    """The error that asks for what a file of `bands` bands leaves unsaid."""
    return TextureError(
        why,
        where=path,
        remedy=f"give --wavelengths first:last:step, a list, or a file with one in nm a line, for {bands} bands",
    )


def as_nanometres(values: Float64Array) -> Float64Array | None:
    """Values that can only be nanometres or only micrometres of light, in nm; None if they are neither."""
    if values.size == 0 or not np.isfinite(values).all():
        return None
    low, high = float(values.min()), float(values.max())
    if low >= _NANOMETRES[0] and high <= _NANOMETRES[1]:
        return values
    if low >= _MICROMETRES[0] and high <= _MICROMETRES[1]:
        # What the product adds beyond a millionth of a nanometre is noise.
        return np.asarray(np.round(values * 1000.0, 6))
    return None


def wavelengths_in_text(text: str, bands: int, path: Path) -> Float64Array | None:
    """Wavelengths (bands,) that a description lists: JSON with ``wavelengths``, or ``wavelength = {400, 410}``.

    None if it lists none.

    Raises
    ------
    TextureError
        If it lists some, and they cannot be those of the bands.
    """
    listed = _listed(text[:_LONGEST_TEXT])
    if listed is None:
        return None
    try:
        found = as_nanometres(np.array([float(str(each)) for each in listed]))
    except ValueError:
        found = None
    if found is None:
        raise TextureError(
            "its description lists wavelengths that are neither nm nor micrometres",
            where=path,
            remedy="give --wavelengths, which come first",
        )
    return checked_wavelengths(found, bands, path)


def _listed(text: str) -> Sequence[object] | None:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = None
    if isinstance(document, dict):
        named = [value for key, value in document.items() if _KEY.fullmatch(key) and isinstance(value, list)]
        return named[0] if len(named) == 1 else None
    match = _LIST.search(text)
    return [part for part in re.split(r"[,;\s]+", match[1]) if part] if match else None


def wavelengths_in_names(stems: Sequence[str]) -> tuple[Float64Array | None, str]:
    """Wavelengths (images,) in nm from file names without their endings, and why there are none.

    A number with a unit is a wavelength; one without is, if it is the only number that differs from
    name to name in a way that wavelengths can. Numbers that count the images are no wavelengths.
    """
    units = [_WITH_UNIT.findall(stem) for stem in stems]
    if any(units):
        return _with_units(units)
    numbers = [_NUMBER.findall(stem) for stem in stems]
    if len({len(each) for each in numbers}) > 1:
        return None, "the names do not hold the same numbers"
    columns = list(zip(*numbers, strict=True))
    plausible = [place for place, column in enumerate(columns) if _could_be_wavelengths(column)]
    if len(plausible) > 1:
        return None, "several numbers in the names could be wavelengths"
    if not plausible:
        return None, "the names hold no wavelengths"
    place = plausible[0]
    behind = {_NUMBER.split(stem)[place + 1] for stem in stems}
    if len(columns) > place + 1 and len(set(columns[place + 1])) > 1 and behind & _BEFORE_DECIMALS:
        return None, "the names may hold wavelengths with decimals"
    return np.array(_floats(columns[place])), ""


def _with_units(units: list[list[tuple[str, str]]]) -> tuple[Float64Array | None, str]:
    """The only column of numbers with units that differs from name to name."""
    if len({len(each) for each in units}) > 1:
        return None, "not all names hold a wavelength"
    columns = [
        np.array([_float(number) * (1.0 if unit[0] in "nN" else 1000.0) for number, unit in column])
        for column in zip(*units, strict=True)
    ]
    varying = [column for column in columns if len(set(column)) > 1] or columns
    if len(varying) > 1:
        return None, "several numbers in the names have units"
    found = np.round(varying[0], 6)
    if found.min() < _NANOMETRES[0] or found.max() > _NANOMETRES[1]:
        return None, "the numbers with units in the names are no wavelengths"
    return found, ""


def _could_be_wavelengths(texts: tuple[str, ...]) -> bool:
    """Distinct numbers of nm that do not count up by one, nor begin with a 0 as counters do."""
    values = np.array(_floats(texts))
    if len(set(texts)) < max(2, len(texts)) or values.min() < _NANOMETRES[0] or values.max() > _NANOMETRES[1]:
        return False
    if any(text.startswith("0") for text in texts) and values.max() < 1000:
        return False
    return not np.array_equal(np.sort(values), values.min() + np.arange(len(values)))


def _floats(texts: Sequence[str]) -> list[float]:
    return [_float(text) for text in texts]


def _float(text: str) -> float:
    return float(text.replace(",", "."))
